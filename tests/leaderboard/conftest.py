"""The cast: an owner, a teammate, and a stranger who must see nothing."""

from pathlib import Path
from typing import Any

import pytest
from django.test import Client

from leaderboard.editions import splits
from leaderboard.models import Edition, Membership, Split, Submission, Team, User
from leaderboard.people import teams
from leaderboard.queue.lifecycle import Lease
from tests import builders, kept
from tests.editions import FACTORS, corrected, open_edition
from tests.leaderboard.web.maintain import queue_rows


@pytest.hookimpl(tryfirst=True)
def pytest_fixture_setup(fixturedef: pytest.FixtureDef[Any], request: pytest.FixtureRequest) -> None:
    """Hold the world that the test begins with, before pytest-django makes a savepoint for the test."""
    if fixturedef.argname == "_django_db_helper":
        kept.prepare(request.node, blocker=request.getfixturevalue("django_db_blocker"))


def make_edition(folder: Path) -> Edition:
    splits.ensure_splits()
    return builders.import_truth(folder)


def make_owner() -> User:
    return User.objects.create_user("owner@example.org", "correct horse", name="Owls")


def _make_four(edition: Edition, owner: User) -> list[Submission]:
    made = [
        builders.submit(owner, builders.predictions(edition, factor=factor), method=f"M{factor}")
        for factor in FACTORS
    ]
    builders.score_all()
    return made


kept.MAKERS["edition"] = make_edition
kept.MAKERS["entries"] = lambda folder: _make_four(make_edition(folder), make_owner())


@pytest.fixture
def owner(db: None) -> User:
    """A user who submits."""
    return User.objects.get(email="owner@example.org") if kept.has_people() else make_owner()


@pytest.fixture
def teammate(owner: User) -> User:
    """A user in the owner's team."""
    user = User.objects.create_user("teammate@example.org", "correct horse", name="Mate")
    Membership.objects.create(team=teams.team_of(user=owner), user=user)
    return user


@pytest.fixture
def team(owner: User, teammate: User) -> Team:
    """The owner's team, with a teammate in it."""
    return teams.team_of(user=owner)


@pytest.fixture
def stranger(db: None) -> User:
    """Another user, in a team of their own."""
    return User.objects.create_user("stranger@example.org", "correct horse", name="Strangers")


@pytest.fixture
def maintainer(db: None) -> User:
    """A user who maintains the benchmark."""
    return User.objects.create_superuser("maintainer@example.org", "correct horse", name="Keepers")


@pytest.fixture
def signed_in(client: Client, owner: User) -> Client:
    """The owner's browser."""
    client.force_login(owner)
    return client


@pytest.fixture
def edition(db: None, tmp_path: Path) -> Edition:
    """The test split, open, with made-up ground truth."""
    if kept.is_kept("edition"):
        kept.copy_files(tmp_path)
        return Edition.objects.select_related("split", "ground_truth").get()
    return make_edition(tmp_path)


@pytest.fixture
def lease(edition: Edition, owner: User) -> Lease:
    """Of a claimed evaluation of a file that nobody will read."""
    queue_rows.queued(edition, owner)
    return queue_rows.claim()


@pytest.fixture
def open_values(benchmark: None) -> None:
    """Open the values of the test split, so all pairs have exact intervals and p."""
    Split.objects.filter(pk="test").update(is_hidden=False)


@pytest.fixture
def entries(edition: Edition, owner: User) -> list[Submission]:
    """Four scored submissions of four methods."""
    if kept.is_kept("entries"):
        return list(Submission.objects.select_related("method__team", "split").order_by("submitted_at"))
    return _make_four(edition, owner)


@pytest.fixture
def second(entries: list[Submission], tmp_path: Path) -> Edition:
    """An edition in preparation, with all of its evaluations waiting."""
    return open_edition(corrected(tmp_path, factor=1.3))


@pytest.fixture
def rescored(second: Edition) -> Edition:
    """The same, with everything of it scored."""
    builders.score_all()
    return second


@pytest.fixture
def keeper(client: Client, maintainer: User) -> Client:
    """A maintainer's browser."""
    client.force_login(maintainer)
    return client
