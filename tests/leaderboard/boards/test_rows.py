"""What a row of a board shows of withdrawn, equal and anonymous entries, beside others of the same kind."""

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta

import pytest
from django.test import Client
from django.utils import timezone

import evaluator
from leaderboard.boards import listing, movement, snapshots, visibility_preview
from leaderboard.boards.rows import ConfidenceInterval as Interval
from leaderboard.boards.rows import Entry, listed, placed, printed_decimals, public_reason
from leaderboard.models import Edition, EditionRanges, Evaluation, Method, Score, Status, Submission, User
from leaderboard.statistics import confidence
from leaderboard.storage import seeds, truth_values
from tests import board_rows, builders
from tests.editions import ANYBODY, publish

NOON = datetime(2026, 11, 20, 12, tzinfo=UTC)
HOUR, DAY = timedelta(hours=1), timedelta(days=1)


@pytest.fixture
def methods(edition: Edition, owner: User) -> list[Method]:
    """Two public methods of two teams, which everybody has seen since a week before noon."""
    made = board_rows.fill(edition, n=2, user=owner)
    Method.objects.update(shown_at=NOON - 7 * DAY)
    Submission.objects.update(submitted_at=NOON - 8 * DAY)
    Evaluation.objects.update(finished_at=NOON - 8 * DAY)
    return made


def rows(edition: Edition, at: datetime | None = None) -> dict[object, Entry]:
    entries = listing.public_rows(split=edition.split, edition=edition, at=at)
    return {entry.method_id: entry for entry in entries if entry.method_id}


def withdraw(method: Method, at: datetime) -> None:
    Submission.objects.filter(method=method).update(withdrawn_at=at)
    builders.board_changed("test")


# --- withdrawn -------------------------------------------------------------------------------------------


def test_a_withdrawn_row_has_neither_value_nor_interval_and_the_other_has_both(
    edition: Edition, methods: list[Method], client: Client
) -> None:
    withdraw(methods[0], NOON)
    gone, stays = (rows(edition)[method.pk] for method in methods)
    assert (set(gone.scores.values()), gone.intervals, gone.rank) == ({None}, {}, None)
    assert stays.intervals.keys() == stays.scores.keys() == gone.scores.keys()
    assert (gone.withdrawn_at, stays.withdrawn_at) == (NOON, None)
    document = client.get("/api/v1/splits/test/board?intervals=yes").json()
    by_id = {row["id"]: row for row in document["entries"]}
    assert set(by_id[str(methods[0].pk)]["intervals"].values()) <= {None}
    assert by_id[str(methods[1].pk)]["intervals"]["mid"]["low"] is not None


@pytest.mark.parametrize(("withdrawn_at", "has_row"), [
    (NOON - 7 * DAY - HOUR, False), (NOON - 7 * DAY, True), (NOON, True),
])  # fmt: skip
def test_what_was_withdrawn_before_anybody_saw_it_has_no_row(
    edition: Edition, methods: list[Method], withdrawn_at: datetime, has_row: bool
) -> None:
    withdraw(methods[0], withdrawn_at)
    assert rows(edition).keys() == {method.pk for method in (methods if has_row else methods[1:])}


@pytest.mark.parametrize("visibility", ["PUBLIC", "ANONYMOUS"])
def test_boards_of_one_day_tell_the_hour_of_a_withdrawal_of_public_methods_alone(
    edition: Edition, methods: list[Method], visibility: str
) -> None:
    Method.objects.filter(pk=methods[0].pk).update(visibility=visibility)
    withdraw(methods[0], NOON)
    before, after, day_before, day_after = (
        rows(edition, at=NOON + change)[methods[0].pk].withdrawn_at is not None
        for change in (-HOUR, HOUR, -DAY, DAY)
    )
    assert (day_before, day_after) == (False, True)
    assert rows(edition, at=NOON)[methods[0].pk].withdrawn_at is not None
    # The whole day counts as the time after it.
    assert (before, after) == (visibility == "ANONYMOUS", True)


@pytest.mark.parametrize("visibility", ["PUBLIC", "ANONYMOUS"])
@pytest.mark.parametrize("what", ["finished", "shown"])
def test_boards_of_one_day_tell_the_hour_at_which_a_public_row_came_alone(
    edition: Edition, methods: list[Method], visibility: str, what: str
) -> None:
    Method.objects.filter(pk=methods[0].pk).update(visibility=visibility)
    if what == "finished":
        Evaluation.objects.filter(submission__method=methods[0]).update(finished_at=NOON)
    else:
        Method.objects.filter(pk=methods[0].pk).update(shown_at=NOON)
    there = [methods[0].pk in rows(edition, at=NOON + change) for change in (-DAY, -HOUR, HOUR)]
    assert there == [False, visibility == "ANONYMOUS", True]
    assert methods[1].pk in rows(edition, at=NOON - DAY)


def test_times_of_an_anonymous_row_are_days(edition: Edition, methods: list[Method]) -> None:
    Method.objects.filter(pk=methods[0].pk).update(visibility="ANONYMOUS")
    withdraw(methods[0], NOON)
    hidden, shown = (rows(edition)[method.pk] for method in methods)
    midnight = NOON - 12 * HOUR
    assert (hidden.date, hidden.shown_at, hidden.withdrawn_at) == (
        midnight - 8 * DAY, midnight - 7 * DAY, midnight,
    )  # fmt: skip
    assert (shown.date, shown.shown_at) == (NOON - 8 * DAY, NOON - 7 * DAY)


# --- equal -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("earlier", [0, 1])
def test_of_two_equal_submissions_the_earlier_one_is_the_row_of_the_method(
    edition: Edition, methods: list[Method], owner: User, earlier: int
) -> None:
    board_rows.score(edition, methods=methods[:1], user=owner, seed=5)
    pair = list(Submission.objects.filter(method=methods[0]).order_by("pk"))
    Score.objects.filter(evaluation__submission__in=pair).update(value=5.0)
    for i, submission in enumerate(pair):
        sent_at = NOON - 8 * DAY if i == earlier else NOON - 7 * DAY
        Submission.objects.filter(pk=submission.pk).update(submitted_at=sent_at)
    row = rows(edition)[methods[0].pk]
    assert (row.submission_id, row.date) == (pair[earlier].pk, NOON - 8 * DAY)
    ranked = confidence.ranked(confidence.active_entries(edition))
    [chosen] = [entry for entry in ranked if entry.method_id == methods[0].pk]
    assert chosen.evaluation_id == row.evaluation_id


def test_a_better_submission_is_the_row_even_if_it_came_later(
    edition: Edition, methods: list[Method], owner: User
) -> None:
    board_rows.score(edition, methods=methods[:1], user=owner, seed=5)
    better = Submission.objects.filter(method=methods[0]).latest("submitted_at")
    Score.objects.filter(evaluation__submission=better).update(value=1.0)
    assert rows(edition)[methods[0].pk].submission_id == better.pk
    Submission.objects.filter(pk=better.pk).update(hidden_at=NOON, withdrawn_at=NOON)
    assert rows(edition)[methods[0].pk].submission_id != better.pk
    Submission.objects.filter(method=methods[0]).update(withdrawn_at=NOON)
    assert rows(edition)[methods[0].pk].submission_id != better.pk
    Submission.objects.filter(method=methods[0]).update(hidden_at=NOON)
    assert rows(edition).keys() == {methods[1].pk}


# --- two editions ----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_attempts_have_the_values_of_their_edition_alone(
    rescored: Edition, edition: Edition, entries: list[Submission]
) -> None:
    publish(rescored)
    read = {}
    for each in (edition, rescored):
        attempts = snapshots.attempts(each, methods=Method.objects.shown())
        read[each.number] = {attempt.submission_id: attempt.scores for attempt in attempts}
        assert read[each.number] == {sent.pk: overall(sent, each) for sent in entries}
    assert read[1] != read[2]


def overall(submission: Submission, edition: Edition) -> Mapping[str, float]:
    scores = Score.objects.filter(
        evaluation__submission=submission, evaluation__edition=edition, ttc_range="overall"
    )
    return dict(scores.values_list("metric", "value"))


def test_attempts_are_active_scored_and_of_the_methods_that_are_asked_for_newest_first(
    edition: Edition, methods: list[Method], owner: User
) -> None:
    board_rows.score(edition, methods=methods * 2, user=owner, seed=3)
    sent = list(Submission.objects.order_by("pk"))
    for i, submission in enumerate(sent):
        Submission.objects.filter(pk=submission.pk).update(submitted_at=NOON + i * HOUR)
    Submission.objects.filter(pk=sent[0].pk).update(withdrawn_at=NOON)
    Evaluation.objects.filter(submission=sent[1]).update(status=Status.REJECTED)
    shown = [attempt.submission_id for attempt in snapshots.attempts(edition, methods=Method.objects.all())]
    assert shown == [submission.pk for submission in reversed(sent[2:])]
    own = snapshots.attempts(edition, methods=Method.objects.filter(pk=methods[0].pk))
    assert {attempt.method_id for attempt in own} == {methods[0].pk}


def test_times_of_attempts_are_days_for_anonymous_methods(edition: Edition, methods: list[Method]) -> None:
    Method.objects.filter(pk=methods[0].pk).update(visibility="ANONYMOUS")
    times = {a.method_id: a.at for a in snapshots.attempts(edition, methods=Method.objects.shown())}
    assert times == {methods[0].pk: NOON - 12 * HOUR - 8 * DAY, methods[1].pk: NOON - 8 * DAY}


# --- quoted ----------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("other", "rank_high"), [(55.0, 2), (55.01, 1)])
def test_a_printed_value_is_as_exact_as_its_row_is_printed(
    edition: Edition, owner: User, other: float, rank_high: int
) -> None:
    """A printed 0.5 may be 0.45, which is not surely worse than 0.10; beside a 55.01 it is at least 0.495."""
    edition.split.published_results.all().delete()
    # The numbers of a hidden split depend on its secret.
    seeds.path().write_text("7" * 2 * seeds.N_BYTES)
    factor = 1.00008
    truth = truth_values.load(edition.ground_truth_id)
    data = builders.predictions(edition, factor=factor)
    report = evaluator.evaluate(evaluator.read_predictions(data, manifest=truth.manifest), truth)
    assert 0.10 < report.flat()["mid"] < 0.102
    names = edition.rules.score_names
    builders.quote("Paper", {"mid": 0.5} | {name: other for name in names if name != "mid"})
    sent = builders.submit(owner, data)
    builders.score_all()
    builders.infer_all()
    kept = EditionRanges.objects.get(edition=edition).ranges[str(sent.evaluations.get().pk)]
    assert kept[names.index("mid")] == [1, rank_high]


def test_rows_of_papers_are_printed_with_one_decimal_unless_a_value_has_two() -> None:
    assert [printed_decimals(row) for row in ([14.8, None], [None, 14.82], [55.0], [0.05, 3.0])] == [
        1,
        2,
        1,
        2,
    ]


# --- words and numbers of a row ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("codes", "reason"),
    [
        (["missing-keys"], "missing-keys"), (["unknown-keys"], "unknown-keys"),
        (["undefined-error"], "undefined-error"), (["zero"], "other"), (["not-finite"], "other"),
        (["nan", "unknown-keys", "missing-keys"], "unknown-keys"), ([], "other"),
    ],
)  # fmt: skip
def test_only_reasons_about_the_edition_are_public(codes: list[str], reason: str) -> None:
    assert public_reason([{"code": code} for code in codes]) == reason


def row(name: str, value: float | None = None, **fields: object) -> Entry:
    return Entry(kind="submission", method=name, team="T", scores={"mid": value}, **fields)


@pytest.mark.parametrize(
    ("date", "shown_at", "since"),
    [(NOON, NOON + DAY, NOON + DAY), (NOON + DAY, NOON, NOON + DAY), (NOON, None, NOON), (None, None, None)],
)
def test_a_row_is_listed_since_the_later_of_sent_and_shown(
    date: datetime | None, shown_at: datetime | None, since: datetime | None
) -> None:
    assert row("A", date=date, shown_at=shown_at).listed_at == since


def test_rows_sort_by_rank_then_value_then_name_and_without_value_last() -> None:
    rows = [
        row("b", 2.0, rank=2), row("A", 2.0, rank=2), row("c", 1.0, rank=1), row("Z", None), row("d", None),
        row("e", 1.9, rank=2),
    ]  # fmt: skip
    assert [entry.method for entry in listed(rows, by="rank")] == ["c", "e", "A", "b", "d", "Z"]
    assert [entry.method for entry in listed(rows, by="-rank")] == ["e", "A", "b", "c", "d", "Z"]
    assert [entry.method for entry in listed(rows, by="method")] == ["A", "b", "c", "d", "e", "Z"]
    assert [entry.method for entry in listed(rows, by="-mid")] == ["A", "b", "e", "c", "d", "Z"]
    assert [entry.method for entry in listed(rows, by="team")] == ["c", "e", "A", "b", "d", "Z"]


def test_rows_sort_by_date_with_those_without_one_last() -> None:
    rows = [row("a", 1.0, date=NOON), row("b", 1.0), row("c", 1.0, date=NOON - DAY), row("d", 1.0, year=2023)]
    assert [entry.method for entry in listed(rows, by="date")] == ["d", "c", "a", "b"]
    assert [entry.method for entry in listed(rows, by="-date")] == ["a", "c", "d", "b"]


@pytest.mark.parametrize(
    ("rank", "kept"), [(1, False), (2, True), (3, True), (4, True), (5, False), (None, True)]
)
def test_a_rank_range_is_dropped_where_the_rank_lies_outside(rank: int | None, kept: bool) -> None:
    entry = row("a", 1.0, intervals={"mid": Interval(0.5, 1.5, 2, 4), "rte": Interval(1, 2, 9, 9)})
    ranked = placed(entry, rank)
    assert ranked.rank == rank
    ends = (2, 4) if kept else (None, None)
    assert ranked.intervals == {"mid": Interval(0.5, 1.5, *ends), "rte": Interval(1, 2, 9, 9)}


def test_a_board_is_as_new_as_its_newest_row_or_its_edition(edition: Edition, methods: list[Method]) -> None:
    edition.split.published_results.all().delete()
    Edition.objects.update(published_at=NOON - 30 * DAY)
    split = Edition.objects.select_related("split__current_edition").get().split

    def updated_at() -> datetime | None:
        return listing.board(split=split, viewer=ANYBODY).updated_at

    assert updated_at() == NOON - 7 * DAY
    Method.objects.filter(pk=methods[0].pk).update(visibility="ANONYMOUS", shown_at=NOON - DAY)
    # The end of the day: its hour could give the team away.
    assert updated_at() == (NOON - DAY).replace(hour=23, minute=59, second=59, microsecond=999_999)
    split.current_edition.published_at = NOON
    assert updated_at() == NOON


# --- changes and previews ---------------------------------------------------------------------------------


def test_changes_name_rows_with_another_rank_or_value_then_those_gone_then_new_ones() -> None:
    def of(slug: str, value: float, rank: int, **fields: object) -> Entry:
        return Entry(
            kind="published",
            method=slug.title(),
            team="T",
            slug=slug,
            scores={"mid": value},
            rank=rank,
            **fields,
        )

    before = [of("same", 1, 1), of("value", 2, 2), of("rank", 3, 3), of("gone", 4, 4), of("first", 5, 5)]
    after = [
        of("same", 1, 1), of("value", 2.5, 2), of("rank", 3, 4), of("new", 0.5, 5),
        of("first", 5, 5, withdrawn_at=NOON), of("between", 9, 9, withdrawn_at=NOON),
    ]  # fmt: skip
    changed = movement.changes(before, after)
    assert [change.entry.slug for change in changed] == ["value", "rank", "first", "gone", "new"]
    assert [(c.before is None, c.after is None) for c in changed][-2:] == [(False, True), (True, False)]


def test_a_preview_counts_the_attempts_of_the_methods_own_team(
    edition: Edition, owner: User, stranger: User
) -> None:
    board_rows.fill(edition, n=12, user=stranger, seed=4)
    mine = builders.send(owner, builders.predictions(edition), method="Mine").submission.method
    shown = Method(team=mine.team, name="Shown", visibility="PUBLIC", shown_at=timezone.now())
    shown.save()
    board_rows.score(edition, methods=[shown, shown, mine], user=owner, seed=7)
    now = timezone.now()
    preview = visibility_preview.preview(method=mine, visibility="PUBLIC", now=now)
    [board] = preview.boards
    assert (board.n_attempts_now, board.entry.n_attempts, board.before) == (2, 3, None)
    assert preview.profile.team == mine.team.name
    assert (board.entry.shown_at, board.n_ranked) == (now, 14 + edition.split.published_results.count())
    again = visibility_preview.preview(method=shown, visibility="PUBLIC", now=now + DAY).boards[0]
    assert (again.entry.shown_at, again.before, again.n_attempts_now) == (shown.shown_at, again.entry, None)
    hidden = visibility_preview.preview(method=mine, visibility="ANONYMOUS", now=now)
    assert hidden.profile.name == mine.pseudonym
    assert hidden.boards[0].entry.n_attempts == 1


def test_a_preview_tells_the_new_rank_of_each_row_that_falls_in_the_order_of_ranks(
    edition: Edition, methods: list[Method], owner: User
) -> None:
    """Two rows have one name, and two one paper; each falls by itself."""
    edition.split.published_results.all().delete()
    for slug, title, name, value in (
        ("a", "One", "same", 20.0), ("b", "Two", "same", 30.0), ("c", "One", "Other", 30.0),
    ):  # fmt: skip
        scores = dict.fromkeys(edition.rules.score_names, value)
        edition.split.published_results.create(
            slug=slug, method_name=name, authors="A", year=2024, source_title=title, source_table="1",
            scores=scores, added_at=NOON - 9 * DAY,
        )  # fmt: skip
    mine = Method.objects.create(team=methods[0].team, name="Mine")
    board_rows.score(edition, methods=[mine], user=owner, seed=3)
    for method, value in ((methods[0], 10.0), (mine, 15.0), (methods[1], 40.0)):
        Score.objects.filter(evaluation__submission__method=method).update(value=value)
    moved = visibility_preview.preview(method=mine, visibility="PUBLIC", now=NOON).boards[0].moved
    assert [(each.entry.slug or each.entry.method, each.entry.rank, each.rank_after) for each in moved] == [
        ("a", 2, 3), ("c", 3, 4), ("b", 3, 4), (methods[1].name, 5, 6),
    ]  # fmt: skip
