"""Boards of the past are made of kept facts, and are what the database says of that moment, row by row."""

from collections.abc import Callable, Iterable
from datetime import datetime, timedelta
from itertools import chain
from pathlib import Path

import pytest
from django.contrib.auth.models import AnonymousUser
from django.db import connection
from django.test import Client
from django.test.utils import CaptureQueriesContext
from django.utils import timezone

from leaderboard import past, snapshots, standings, submissions, teams, visibility
from leaderboard.models import (
    Edition,
    Evaluation,
    Method,
    Publication,
    PublishedResult,
    Score,
    Snapshot,
    Split,
    Submission,
    User,
    Visibility,
)
from leaderboard.snapshots import BOARD, PAST
from tests import board_rows, builders
from tests.editions import ANYBODY, extended, open_edition, publish, quote, roll_back

A_MOMENT = timedelta(microseconds=1)
MAX_STATEMENTS = 3


def events() -> list[datetime]:
    """Every moment at which a board may have become another one."""
    known: Iterable[datetime | None] = chain(
        Submission.objects.values_list("submitted_at", flat=True),
        Submission.objects.values_list("withdrawn_at", flat=True),
        Evaluation.objects.values_list("finished_at", flat=True),
        Method.objects.values_list("shown_at", flat=True),
        Publication.objects.values_list("at", flat=True),
        PublishedResult.objects.values_list("added_at", flat=True),
        PublishedResult.objects.values_list("replaced_at", flat=True),
    )
    return sorted({moment for moment in known if moment is not None})


def assert_the_same(viewer: User | AnonymousUser, *, sort: str = "rank") -> set[tuple[str, ...]]:
    """Compare every board of the past with the database. Returns which boards there were."""
    split = Split.objects.select_related("published_edition__ground_truth").get(pk="test")
    found = set()
    for event in events():
        for at in (event - A_MOMENT, event, event + A_MOMENT):
            asked = {"split": split, "viewer": viewer, "at": at, "sort": sort}
            expected = standings.board(**asked)
            assert snapshots.board(**asked) == expected, at
            found.add((str(expected.edition), *map(repr, expected.entries)))
    return found


def show(name: str, to: Visibility, user: User) -> None:
    method = Method.objects.get(name=name)
    visibility.change(method=method, visibility=to, actor=user, now=timezone.now())


def withdraw(submission: Submission, user: User) -> None:
    assert submissions.withdraw(submission=submission, actor=user, now=timezone.now())


def send(user: User, edition: Edition, method: str, factor: float) -> None:
    builders.submit(user, builders.predictions(edition, factor=factor), method=method)
    builders.score_all()


def write(user: User, edition: Edition, method: str, *, seed: int) -> Submission:
    """A scored submission with intervals and ranges, written row by row."""
    team = teams.team_of(user=user)
    row, _ = Method.objects.get_or_create(team=team, name=method)
    board_rows.score(edition, methods=[row], user=user, seed=seed)
    builders.board_changed(edition.split_id)
    return row.submissions.latest("submitted_at")


@pytest.fixture
def eventful(edition: Edition, owner: User, stranger: User) -> list[Submission]:
    """Methods of all kinds, with attempts better and worse, some withdrawn, some before anybody saw them."""
    board_rows.fill(edition, n=4, user=stranger)
    made = [write(owner, edition, "Steady", seed=1)]
    show("Steady", Visibility.PUBLIC, owner)
    made += [write(owner, edition, "Steady", seed=seed) for seed in (2, 3)]
    made += [write(stranger, edition, "Rival", seed=1)]
    show("Rival", Visibility.PUBLIC, stranger)
    made += [write(owner, edition, "Masked", seed=4)]
    show("Masked", Visibility.ANONYMOUS, owner)
    made += [write(owner, edition, "Late", seed=seed) for seed in (5, 6)]
    withdraw(made[-1], owner)
    show("Late", Visibility.ANONYMOUS, owner)
    made += [write(owner, edition, "Never", seed=7)]
    withdraw(min(made[:3], key=_mid), owner)
    withdraw(made[3], stranger)
    return made


def _mid(submission: Submission) -> float:
    return Score.objects.get(evaluation__submission=submission, metric="mid", interval="overall").value


# --- it is what the database says --------------------------------------------------------------------------


def test_it_is_what_the_database_says_at_every_moment(
    eventful: list[Submission], owner: User, stranger: User
) -> None:
    to_anybody = assert_the_same(ANYBODY)
    assert len(to_anybody) >= 9  # what happened to anonymous methods on one day is one board
    assert assert_the_same(owner, sort="-rte") != to_anybody
    assert assert_the_same(stranger) != to_anybody


def test_it_follows_every_change(edition: Edition, eventful: list[Submission], owner: User) -> None:
    changes: list[Callable[[], object]] = [
        lambda: show("Masked", Visibility.PUBLIC, owner),
        lambda: show("Late", Visibility.PUBLIC, owner),
        lambda: withdraw(sorted(eventful[:3], key=_mid)[1], owner),
        lambda: send(owner, edition, "Steady", 1.02),
        lambda: visibility.change(
            method=Method.objects.get(name="Never"),
            visibility=Visibility.ANONYMOUS,
            actor=owner,
            now=timezone.now(),
            reveal_at=timezone.now() + timedelta(milliseconds=1),
        ),
        lambda: visibility.reveal_due(now=timezone.now() + timedelta(hours=1)),
        lambda: quote("deep-scale", mid=1.0),
        lambda: quote("deep-scale", mid=2.0),
        lambda: quote("later", mid=3.0),
    ]
    seen = assert_the_same(ANYBODY)
    for change in changes:
        change()
        before, seen = seen, assert_the_same(ANYBODY)
        assert seen != before
    assert_the_same(owner)


def test_it_is_of_the_edition_that_was_the_board(
    entries: list[Submission], owner: User, stranger: User, tmp_path: Path
) -> None:
    # No file has a value for what was added, so none can be scored in the second.
    second = open_edition(extended(tmp_path))
    builders.score_all()
    publish(second, leave_out=True)
    assert any("unscorable='missing-keys'" in row for board in assert_the_same(ANYBODY) for row in board)
    send(stranger, second, "Short", 1.12)
    assert_the_same(ANYBODY)
    quote("after-the-first", mid=1.0)
    roll_back()
    quote("after-the-second", mid=2.0)
    assert_the_same(ANYBODY)
    builders.score_all()
    found = assert_the_same(ANYBODY)
    assert {board[0] for board in found} == {"None", "test edition 1", "test edition 2"}
    # The first edition scores them all: what the second one had more is left aside.
    assert not any("unscorable='missing-keys'" in row for board in found for row in board)
    assert_the_same(owner)


def test_intervals_that_come_later_are_told_of_the_past(entries: list[Submission]) -> None:
    before = assert_the_same(ANYBODY)
    assert builders.infer_all() > 0
    assert assert_the_same(ANYBODY) != before


def test_what_is_kept_is_what_was_read(edition: Edition, eventful: list[Submission]) -> None:
    drawn = snapshots.draw(edition, PAST)
    kept = Snapshot.objects.get(form=PAST.name)
    assert PAST.read(bytes(kept.body)) == drawn == past.facts(Edition.objects.get())
    assert len(drawn.runs) == 4 + 7


def test_the_form_of_the_present_holds_nothing_of_the_past_and_the_other_way_round(
    edition: Edition, eventful: list[Submission]
) -> None:
    split = edition.split
    at = timezone.now()
    for frame in (None, snapshots.edition_at(split, at), snapshots.editions().get()):
        for moment in (None, at):
            asked = {"split": split, "edition": frame, "viewer": ANYBODY, "at": moment}
            assert snapshots.board(**asked) == standings.board(**asked)
    assert BOARD.read(bytes(Snapshot.objects.get(form=PAST.name).body)) is None


# --- nothing private moves it ------------------------------------------------------------------------------


def test_what_is_private_is_not_among_the_facts(
    edition: Edition, eventful: list[Submission], owner: User
) -> None:
    before = snapshots._at_present(edition, PAST)[0].body
    assert b"Never" not in before
    assert b"Masked" not in before
    write(owner, edition, "Hidden", seed=8)
    assert snapshots._at_present(edition, PAST)[0].body == before


# --- what it costs -----------------------------------------------------------------------------------------


def n_statements(client: Client, address: str) -> int:
    with CaptureQueriesContext(connection) as captured:
        assert client.get(address).status_code == 200, address
    return len(captured)


def test_rows_that_say_why_they_stay_behind_cost_no_statement(
    entries: list[Submission], client: Client, tmp_path: Path
) -> None:
    at = timezone.now()
    second = open_edition(extended(tmp_path))
    builders.score_all()
    publish(second, leave_out=True)
    addresses = (f"/board/test/?at={at:%Y-%m-%dT%H:%M:%S.%fZ}", "/board/test/editions/1/")
    for address in addresses:
        assert "Edition 2 added sequences that its file does not predict." in client.get(address).text
        snapshots.PAST.memory.clear()
        snapshots.BOARD.memory.clear()
        assert n_statements(client, address) <= MAX_STATEMENTS


def test_a_worker_draws_the_past_where_somebody_reads_it(
    edition: Edition, entries: list[Submission], client: Client
) -> None:
    assert snapshots.redraw(split_id="test", now=timezone.now())
    assert set(Snapshot.objects.values_list("form", flat=True)) == {BOARD.name}
    address = f"/api/v1/splits/test/board?at={timezone.now():%Y-%m-%dT%H:%M:%S.%fZ}"
    right = client.get(address).json()
    builders.board_changed("test")
    assert snapshots.redraw(split_id="test", now=timezone.now() + timedelta(seconds=2))
    PAST.memory.clear()
    assert n_statements(client, address) == MAX_STATEMENTS
    assert client.get(address).json() == right


def test_what_was_changed_by_hand_is_found_in_the_past_as_well(
    edition: Edition, entries: list[Submission], client: Client
) -> None:
    address = f"/api/v1/splits/test/board?at={timezone.now():%Y-%m-%dT%H:%M:%S.%fZ}"
    old = client.get(address).json()
    Score.objects.filter(metric="mid", interval="overall").update(value=1.0)
    assert client.get(address).json() == old
    assert snapshots.check(now=timezone.now() + timedelta(hours=1)) == 1
    rows = [e for e in client.get(address).json()["entries"] if e["kind"] == "submission"]
    assert {row["scores"]["mid"] for row in rows} == {1.0}
