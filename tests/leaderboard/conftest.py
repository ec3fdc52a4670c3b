"""The cast: an owner, a teammate, and a stranger who must see nothing."""

from pathlib import Path

import pytest
from django.test import Client

from leaderboard.models import Edition, Membership, Split, Submission, Team, User
from leaderboard.people import teams
from leaderboard.scoring.lifecycle import Lease
from tests import builders
from tests.editions import FACTORS, corrected, open_edition
from tests.leaderboard.web.maintain import queue_rows


@pytest.fixture
def owner(db: None) -> User:
    """Somebody who submits."""
    return User.objects.create_user("owner@example.org", "correct horse", name="Owls")


@pytest.fixture
def teammate(owner: User) -> User:
    """Somebody in the owner's team."""
    user = User.objects.create_user("teammate@example.org", "correct horse", name="Mate")
    Membership.objects.create(team=teams.team_of(user=owner), user=user)
    return user


@pytest.fixture
def team(owner: User, teammate: User) -> Team:
    """The owner's team, with a teammate in it."""
    return teams.team_of(user=owner)


@pytest.fixture
def stranger(db: None) -> User:
    """Somebody else, in a team of their own."""
    return User.objects.create_user("stranger@example.org", "correct horse", name="Strangers")


@pytest.fixture
def maintainer(db: None) -> User:
    """Somebody who looks after the benchmark."""
    return User.objects.create_superuser("maintainer@example.org", "correct horse", name="Keepers")


@pytest.fixture
def signed_in(client: Client, owner: User) -> Client:
    """The owner's browser."""
    client.force_login(owner)
    return client


@pytest.fixture
def edition(benchmark: None, tmp_path: Path) -> Edition:
    """The test split, open, with made-up ground truth."""
    return builders.import_truth(tmp_path)


@pytest.fixture
def lease(edition: Edition, owner: User) -> Lease:
    """Of a claimed evaluation of a file that nobody will read."""
    queue_rows.queued(edition, owner)
    return queue_rows.claim()


@pytest.fixture
def open_values(benchmark: None) -> None:
    """The values of the test split are open: intervals and p are told of all pairs, and exactly."""
    Split.objects.filter(pk="test").update(is_hidden=False)


@pytest.fixture
def entries(edition: Edition, owner: User) -> list[Submission]:
    """Four scored submissions of four methods."""
    made = [
        builders.submit(owner, builders.predictions(edition, factor=factor), method=f"M{factor}")
        for factor in FACTORS
    ]
    builders.score_all()
    return made


@pytest.fixture
def second(entries: list[Submission], tmp_path: Path) -> Edition:
    """An edition in preparation beside the board, with everything of it waiting."""
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
