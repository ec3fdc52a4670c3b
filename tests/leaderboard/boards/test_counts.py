"""What is counted beside a row and on a board: of that split, edition, team and method alone."""

from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest
from django.utils import timezone

from evaluator import SCORE_NAMES
from evaluator.metrics.protocol import DEFAULT_PROTOCOL
from leaderboard.boards import filters, listing, movement, results, snapshots
from leaderboard.boards.rows import Entry, scored_in
from leaderboard.methods.details import MAX_FILTER_TEXT
from leaderboard.models import Edition, Evaluation, Method, Score, Split, Status, Submission, User
from leaderboard.people import teams
from tests import board_rows, builders
from tests.editions import ANYBODY

Four = dict[str, Method]


@pytest.fixture
def four(edition: Edition, owner: User, stranger: User) -> Four:
    """Methods of the owner's team, seen in three ways, and a public one of a stranger; each sent twice."""
    edition.split.published_results.all().delete()
    now, made = timezone.now(), {}
    for name, user, visibility in (
        ("First", owner, "PUBLIC"), ("Second", owner, "PUBLIC"), ("Hidden", owner, "PRIVATE"),
        ("Veiled", owner, "ANONYMOUS"), ("Other", stranger, "PUBLIC"),
    ):  # fmt: skip
        shown_at = None if visibility == "PRIVATE" else now
        team = teams.team_of(user=user)
        made[name] = Method.objects.create(team=team, name=name, visibility=visibility, shown_at=shown_at)
    for seed in (1, 2):
        board_rows.score(edition, methods=list(made.values()), user=owner, seed=seed)
    builders.board_changed("test")
    return made


def split_called(name: str = "test") -> Split:
    return Split.objects.select_related("current_edition__ground_truth").get(pk=name)


def attempts(viewer: User | None = None) -> dict[str, int | None]:
    board = listing.board(split=split_called(), viewer=viewer or ANYBODY)
    return {entry.method: entry.n_attempts for entry in board.entries}


def test_attempts_count_scored_submissions_to_this_split_alone(
    four: Four, edition: Edition, owner: User, tmp_path: Path
) -> None:
    veiled = four["Veiled"].pseudonym
    assert attempts() == {"First": 4, "Second": 4, veiled: 2, "Other": 2}
    own = {"First": 4, "Second": 4, "Veiled": 2, "Other": 2, "Hidden": 2}
    assert attempts(owner) == own
    val = builders.import_truth(tmp_path, split="val")
    board_rows.score(val, methods=[four["First"], four["Hidden"]], user=owner, seed=3)
    last = Evaluation.objects.filter(submission__method=four["Second"], edition=edition).first()
    Evaluation.objects.filter(pk=last.pk).update(status=Status.REJECTED)
    assert attempts(owner) == own | {"First": 3, "Second": 3}


def test_attempts_of_a_draft_are_not_counted(four: Four, edition: Edition, owner: User) -> None:
    draft = Edition.objects.create(
        split=edition.split,
        ground_truth=edition.ground_truth,
        number=2,
        protocol=edition.protocol,
        decimals=2,
    )
    board_rows.score(draft, methods=[four["Other"]], user=owner, seed=3)
    assert attempts()["Other"] == 2
    [late] = board_rows.fill(draft, n=1, user=owner)
    own = Method.objects.create(team=four["First"].team, name="Own", visibility="PRIVATE")
    board_rows.score(draft, methods=[own], user=owner, seed=4)
    board = listing.board(split=split_called(), edition=draft, viewer=owner)
    assert {entry.method: entry.n_attempts for entry in board.entries} == {"Other": 2, late.name: 0, "Own": 0}
    Edition.objects.filter(pk=draft.pk).update(published_at=timezone.now())
    assert attempts()["Other"] == 3


def test_what_earlier_editions_scored_and_this_one_did_not_is_counted_where_there_is_no_row(
    four: Four, edition: Edition, owner: User
) -> None:
    def n_left_behind(**options: object) -> int:
        return listing.board(split=split_called(), viewer=ANYBODY, **options).n_left_behind

    assert n_left_behind() == 0
    second = Edition.objects.create(
        split=edition.split, ground_truth=edition.ground_truth, number=2, protocol=edition.protocol,
        decimals=2, published_at=timezone.now(),
    )  # fmt: skip
    Split.objects.filter(pk="test").update(current_edition=second)
    # Of four shown methods; the private one is nobody's business.
    assert n_left_behind() == 8
    first = Submission.objects.filter(method=four["First"]).first()
    Submission.objects.filter(pk=first.pk).update(withdrawn_at=timezone.now())
    other = Evaluation.objects.filter(submission__method=four["Other"]).first()
    Evaluation.objects.filter(pk=other.pk).update(status=Status.REJECTED)
    assert n_left_behind() == 6
    assert n_left_behind(at=timezone.now()) == 0
    board_rows.score(second, methods=[four["Other"]], user=owner, seed=4)
    assert n_left_behind() == 0


def test_values_are_those_of_an_edition_and_of_the_evaluations_that_are_asked_for(
    four: Four, edition: Edition, owner: User, tmp_path: Path
) -> None:
    val = builders.import_truth(tmp_path, split="val")
    board_rows.score(val, methods=[four["First"]], user=owner, seed=3)
    here = set(Evaluation.objects.filter(edition=edition).values_list("pk", flat=True))
    assert scored_in(edition).keys() == here
    two = sorted(here)[:2]
    chosen = scored_in(edition, evaluations=two)
    assert chosen == {pk: scored_in(edition)[pk] for pk in two}
    score = Score.objects.get(evaluation=two[0], metric="mid", ttc_range="overall")
    assert chosen[two[0]].values["mid"] == score.value
    assert (chosen[two[0]].intervals["mid"].low, chosen[two[0]].intervals["mid"].high) == (
        score.low,
        score.high,
    )
    assert scored_in(edition, evaluations=[]) == {}


def test_a_board_is_sorted_by_each_of_its_columns_and_by_no_other() -> None:
    for name in ("rank", "method", "team", "date", *SCORE_NAMES):
        for sign in ("", "-"):
            listing.require_column(sign + name)
    for name in ("", "kind", "--mid"):
        with pytest.raises(listing.UnknownColumn, match="expected one of rank, method, team, date, mid"):
            listing.require_column(name)


def test_a_long_column_is_shortened_in_what_is_said_of_it() -> None:
    wrong = listing.UnknownColumn("x" * 70, known=["rank"])
    assert f"no “{'x' * 60}” column" in wrong.on_page
    assert ("'" + "x" * 60 + "' is not a date") in str(listing.BadTime("x" * 70))


def test_floor_of_a_board_has_the_columns_of_its_edition_in_their_order() -> None:
    floor = {"rte": 2.0, "other": 9.0, "mid": 1.0}
    for edition, expected in (
        (Edition(floor=floor, protocol=DEFAULT_PROTOCOL), [("mid", 1.0), ("rte", 2.0)]),
        (Edition(protocol=DEFAULT_PROTOCOL), None),
        (None, None),
    ):
        found = listing.Board(split=Split(), edition=edition, entries=()).floor
        assert (list(found.items()) if found else found) == expected


@pytest.mark.parametrize(("days", "text"), [(-1, "Beware."), (0, ""), (1, "")])
def test_line_of_the_site_is_shown_until_it_ends(days: int, text: str) -> None:
    now = timezone.now()
    ends_at = now - timedelta(days=days)
    split, silent = (
        cast("Split", SimpleNamespace(site_line=line, site_line_ends_at=end))
        for line, end in (("Beware.", ends_at), (None, None))
    )
    assert snapshots.site_line_of([silent, split], now=now) == text
    assert snapshots.site_line_of([silent], now=now) == ""


@pytest.mark.parametrize("n_more", [0, 1])
def test_filter_takes_a_text_up_to_its_limit(n_more: int) -> None:
    text = "x" * (MAX_FILTER_TEXT + n_more)
    if n_more:
        with pytest.raises(
            filters.BadFilter, match=f"at most {MAX_FILTER_TEXT} characters, found {len(text)}"
        ):
            filters.parse({"q": text})
    else:
        assert filters.parse({"q": text, "paper": " "}).wanted.keys() == {"q"}


def test_an_attempt_ranks_by_its_first_score(four: Four, edition: Edition) -> None:
    for attempt in snapshots.attempts(edition, methods=Method.objects.all()):
        score = Score.objects.get(
            evaluation__submission=attempt.submission_id, metric="mid", ttc_range="overall"
        )
        assert attempt.value == score.value
        assert attempt.scores.keys() == {"mid", "rte"}


# --- the results of one method ----------------------------------------------------------------------------


def entry(name: str, value: float | None, rank: int | None = None) -> Entry:
    return Entry(kind="published", method=name, slug=name, team="T", scores={"mid": value}, rank=rank)


def test_changes_are_in_the_order_of_rank_then_name_with_those_without_rank_last() -> None:
    before = [entry("a", 9.0, 9), entry("B", 9.0, 9), entry("c", 9.0, 9), entry("d", 9.0, 9)]
    after = [entry("a", 1.0, 2), entry("B", 2.0, 2), entry("c", 3.0, 1), entry("d", None, None)]
    assert [change.entry.slug for change in movement.changes(before, after)] == ["c", "a", "B", "d"]


def names(entries: Sequence[Entry]) -> list[str]:
    return [each.method for each in entries]


def set_values(four: Four, **values: float) -> None:
    for name, value in values.items():
        Score.objects.filter(evaluation__submission__method=four[name]).update(value=value)
    builders.board_changed("test")


def test_a_methods_result_has_its_best_rival_and_the_two_that_are_nearest(four: Four, owner: User) -> None:
    set_values(four, First=1.0, Second=2.0, Veiled=3.0, Other=4.0)
    neighbours = {}
    for name in ("First", "Second", "Veiled", "Other"):
        [found] = results.results(method=four[name], viewer=owner)
        neighbours[name] = (found.best.method, names(found.neighbours), found.n_ranked, len(found.attempts))
        assert names(found.rivals) == list(dict.fromkeys([found.best.method, *names(found.neighbours)]))
    assert neighbours == {
        "First": ("Second", ["Second", "Veiled"], 4, 2),
        "Second": ("First", ["First", "Veiled"], 4, 2),
        "Veiled": ("First", ["Second", "Other"], 4, 2),
        "Other": ("First", ["Second", "Veiled"], 4, 2),
    }


@pytest.mark.parametrize(
    ("values", "neighbours"),
    [
        ((2.0, 0.0, 2.0, 3.0), ["Second", "Veiled"]),  # an equal one comes after
        ((0.0, 0.5, 1.0, 2.0), ["Second", "Veiled"]),
        ((3.0, 0.0, 0.5, 2.0), ["Veiled", "Other"]),
        ((1.0, 0.0, 2.0, None), ["Second", "Veiled"]),
        ((3.0, 0.0, 2.0, None), ["Second", "Veiled"]),
        ((3.0, 0.0, None, None), ["Second"]),
        ((0.0, 3.0, None, None), ["Second"]),
        ((0.0, None, None, None), []),
    ],
)
def test_neighbours_are_the_row_before_and_the_one_after_or_the_two_next_to_an_end(
    four: Four, values: Sequence[float | None], neighbours: list[str]
) -> None:
    for name, value in zip(("First", "Second", "Veiled", "Other"), values, strict=True):
        if value is None:
            Submission.objects.filter(method=four[name]).update(withdrawn_at=timezone.now())
        else:
            set_values(four, **{name: value})
    four["Veiled"].visibility = "PUBLIC"
    four["Veiled"].save()
    builders.board_changed("test")
    [found] = results.results(method=four["First"], viewer=ANYBODY)
    assert names(found.neighbours) == neighbours
    if neighbours:
        assert (found.best.method, found.best.value) == ("Second", values[1])
    else:
        assert found.best is None


def test_a_private_method_is_counted_for_its_team_where_it_would_be_and_seen_by_nobody_else(
    four: Four, owner: User, stranger: User
) -> None:
    set_values(four, First=1.0, Second=2.0, Veiled=3.0, Other=4.0, Hidden=2.5)
    [own] = results.results(method=four["Hidden"], viewer=owner)
    assert (own.entry.rank, own.n_ranked, len(own.attempts)) == (3, 5, 2)
    assert {attempt.method_id for attempt in own.attempts} == {four["Hidden"].pk}
    assert names(own.neighbours) == ["Second", "Veiled"]
    for viewer in (stranger, ANYBODY):
        assert results.results(method=four["Hidden"], viewer=viewer) == ()


def test_own_rows_are_those_of_the_team_with_a_value_best_first(
    four: Four, owner: User, stranger: User, maintainer: User
) -> None:
    set_values(four, First=5.0, Second=2.0, Veiled=3.0, Other=4.0, Hidden=1.0)
    splits = snapshots.splits()
    [own] = results.own_rows(viewer=owner, splits=splits)
    assert names(own.own) == ["Hidden", "Second", "Veiled", "First"]
    assert own.n_ranked == 5
    [others] = results.own_rows(viewer=stranger, splits=splits)
    assert (names(others.own), others.n_ranked) == (["Other"], 4)
    assert results.own_rows(viewer=maintainer, splits=splits) == []
    Submission.objects.filter(method=four["Other"]).update(withdrawn_at=timezone.now())
    builders.board_changed("test")
    assert results.own_rows(viewer=stranger, splits=snapshots.splits()) == []
