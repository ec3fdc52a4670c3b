"""A board as of a time is the board that everybody was shown at that time."""

import random
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from django.db.models import F, Model
from django.test import Client
from django.utils import timezone

from leaderboard.editions import corrections
from leaderboard.methods import editing, visibility
from leaderboard.models import (
    Edition,
    Evaluation,
    Method,
    Publication,
    PublishedResult,
    Split,
    Submission,
    Team,
    User,
    Visibility,
)
from leaderboard.people import teams
from leaderboard.submissions import intake
from tests import builders
from tests.editions import corrected, extended, open_edition, publish, quote, roll_back
from tests.leaderboard.boards.test_snapshots import n_queries

pytestmark = pytest.mark.slow
API, CSV = "/api/v1/splits/test/board", "/board/test.csv"
N_EVENTS = 20
A_DAY = timedelta(days=1)
TIMES: tuple[tuple[type[Model], tuple[str, ...]], ...] = (
    (Submission, ("submitted_at", "withdrawn_at")),
    (Evaluation, ("finished_at",)),
    (Method, ("shown_at", "renamed_at")),
    (Team, ("renamed_at",)),
    (Edition, ("published_at",)),
    (Publication, ("at",)),
    (PublishedResult, ("added_at", "replaced_at")),
)


class History:
    """A split to which something happens every day, by chance, and what everybody was shown on that day."""

    def __init__(
        self, edition: Edition, users: list[User], folder: Path, *, seed: int, renames: bool
    ) -> None:
        self.shown: list[tuple[datetime, dict[str, Any], bytes]] = []
        self._edition, self._users, self._folder = edition, users, folder
        self._rng = random.Random(seed)
        self._renames = renames
        self._day = timezone.now().replace(hour=12, minute=0) - 2 * N_EVENTS * A_DAY
        self._n = 0

    def walk(self) -> None:
        """Let it happen. What a file scores is seen on the day when it came."""
        events: list[Callable[[], object]] = [
            *[self._send] * 6,
            *[self._show] * 4,
            *[self._withdraw] * 3,
            self._quote,
            self._correct,
            self._roll_back,
        ]
        if self._renames:
            events += [self._reveal, self._rename] * 2
        self._end_day()
        for event in [self._send, self._send, self._show, *self._rng.choices(events, k=N_EVENTS)]:
            event()
            builders.score_all()
            self._end_day()

    def _end_day(self) -> None:
        """Move what has just happened to a day of its own, and write down what everybody sees."""
        now = timezone.now()
        for model, names in TIMES:
            for name in names:
                rows = model._default_manager.filter(**{f"{name}__gt": now - A_DAY / 2})
                rows.update(**{name: F(name) - (now - self._day)})
        builders.board_changed("test")
        client = Client()
        self.shown.append((self._day, client.get(API).json(), client.get(CSV).content))
        self._day += A_DAY

    # --- what may happen ------------------------------------------------------------------------------------

    def _send(self) -> None:
        user, factor = self._rng.choice(self._users), 1 + self._rng.randint(1, 60) / 100
        self._n += 1
        data = builders.predictions(self._edition, factor=factor) + b" " * self._n
        builders.submit(
            user, data, method=f"Net {self._rng.randint(1, 2)} of {user.pk}", visibility="PRIVATE"
        )

    def _show(self) -> None:
        for method in self._some(Method.objects.filter(visibility=Visibility.PRIVATE)):
            to = Visibility.ANONYMOUS if self._rng.random() < 0.4 else Visibility.PUBLIC
            self._set(method, to)

    def _reveal(self) -> None:
        for method in self._some(Method.objects.filter(visibility=Visibility.ANONYMOUS)):
            self._set(method, Visibility.PUBLIC)

    def _set(self, method: Method, to: Visibility) -> None:
        visibility.change(method=method, visibility=to, actor=self._of(method.team), now=timezone.now())

    def _withdraw(self) -> None:
        for sent in self._some(Submission.objects.filter(withdrawn_at=None), by="submitted_at"):
            intake.withdraw(submission=sent, actor=sent.submitted_by, now=timezone.now())

    def _rename(self) -> None:
        self._n += 1
        for method in self._some(
            Method.objects.exclude(visibility=Visibility.PUBLIC).filter(renamed_at=None)
        ):
            editing.edit(method=method, changes={"name": f"Renamed {self._n}"}, actor=self._of(method.team))
        for team in self._some(Team.objects.filter(renamed_at=None)):
            teams.rename(team=team, name=f"Team {self._n}", actor=self._of(team), now=timezone.now())

    def _quote(self) -> None:
        quote(self._rng.choice(["deep-scale", "later"]), mid=float(self._rng.randint(1, 60)))

    def _correct(self) -> None:
        self._n += 1
        published = Split.objects.get(pk="test").current_edition
        path = corrected(self._folder, factor=1 + self._n / 100)
        second = open_edition(path)
        builders.score_all()
        publish(second, replaces=published.number)

    def _roll_back(self) -> None:
        split = Split.objects.get(pk="test")
        if corrections.predecessor(split) is not None:
            roll_back(replaces=split.current_edition.number)

    def _some(self, rows: Any, *, by: str = "name") -> list[Any]:
        """Choose one of these rows, the same in every run although ids are random."""
        choices = list(rows.order_by(by))
        return [self._rng.choice(choices)] if choices else []

    @staticmethod
    def _of(team: Team) -> User:
        return User.objects.get(membership__team=team)


def lasting(entry: dict[str, Any], *, renames: bool) -> dict[str, Any]:
    """Select the fields of a row that a board of the past never changes.

    A name and the moments of a day come to light when a method is shown under its name, on all of its boards.
    """
    if not renames:
        return entry
    kept = {name: entry[name] for name in ("kind", "rank", "scores", "method_id")}
    return kept | {name: (entry[name] or "")[:10] for name in ("date", "withdrawn_at")}


@pytest.mark.parametrize(("seed", "renames"), [(0, False), (1, True)])
def test_it_is_what_was_shown_on_that_day(
    edition: Edition, owner: User, stranger: User, client: Client, tmp_path: Path, seed: int, renames: bool
) -> None:
    third = User.objects.create_user("third@example.org", "correct horse", name="Jays")
    history = History(edition, [owner, stranger, third], tmp_path, seed=seed, renames=renames)
    history.walk()
    assert len({csv for _, _, csv in history.shown}) > N_EVENTS / 3
    for day, then, csv in history.shown:
        for at in (f"{day:%Y-%m-%d}", day.isoformat()):
            past = client.get(API, {"at": at}).json()
            assert past["edition"] == then["edition"], at
            rows = [[lasting(entry, renames=renames) for entry in board["entries"]] for board in (past, then)]
            assert rows[0] == rows[1], at
            if not renames:
                assert client.get(CSV, {"at": at}).content == csv, at


def test_it_is_read_once_until_the_board_changes(
    entries: list[Submission], client: Client, tmp_path: Path
) -> None:
    query = f"?at={timezone.now():%Y-%m-%dT%H:%M:%S.%fZ}"
    second = open_edition(extended(tmp_path))
    builders.score_all()
    publish(second, leave_out=True)
    page = f"/board/test/{query}"
    client.get("/board/test/")  # The page says what has changed since, too; the present board is kept apart.
    assert 3 < n_queries(client, page) <= 8
    for address in (page, f"{page}&sort=-rte", f"{CSV}{query}", f"{API}{query}"):
        assert n_queries(client, address) <= 3, address
    assert "Edition 2 added sequences that its file does not predict." in client.get(page).text
    intake.withdraw(submission=entries[0], actor=entries[0].submitted_by, now=timezone.now())
    client.get("/board/test/")
    assert 3 < n_queries(client, page) <= 8
