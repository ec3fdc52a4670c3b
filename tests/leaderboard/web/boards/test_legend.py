"""The sentences below a board's tools: how to read its table."""

from datetime import UTC, datetime
from typing import Any

import pytest
from django.core.paginator import Paginator

from evaluator.metrics.protocol import DEFAULT_PROTOCOL, get_protocol
from leaderboard.boards.filters import Filters
from leaderboard.boards.listing import Board
from leaderboard.boards.rows import ConfidenceInterval, Entry
from leaderboard.models import Edition, Split
from leaderboard.web.boards.board_query import BoardQuery
from leaderboard.web.boards.legend import Legend, legend
from leaderboard.web.boards.rank_ladder import Ladder, rank_ladder
from leaderboard.web.boards.tables import BoardRow, BoardTable, counted_ranges

SOURCE = ("Shi (2023). ", "Scale", ", Table 2.", "https://example.org/paper")
RULES = get_protocol(DEFAULT_PROTOCOL)


def row(rank: int, *, low: int | None = None, high: int | None = None) -> BoardRow:
    interval = ConfidenceInterval(low=1.0, high=2.0, rank_low=low, rank_high=high)
    entry = Entry(
        kind="submission",
        method=f"M{rank}",
        team="T",
        scores={"mid": 1.0},
        rank=rank,
        intervals={"mid": interval},
    )
    return BoardRow(
        entry=entry,
        team="T",
        cells=(),
        rank_range="",
        why_no_interval="",
        source_number=None,
        note="",
        attempts="",
        chips=(),
        is_new=False,
        moved=0,
    )


def drawn(*, ladder: Ladder | None = None, counts: dict[str, int] | None = None, **changes: Any) -> Legend:
    """The legend of a table with whiskers, and of 1,234 rows in all."""
    table: dict[str, Any] = {
        "query": BoardQuery(),
        "text_headings": {},
        "range_choices": (),
        "groups": (),
        "score_headings": (),
        "primary": "MiD",
        "rows": (row(1),),
        "moved_since": None,
        "sources": [],
        "ttc_ranges": counted_ranges(RULES, counts or {}),
        "pages": Paginator([], 1).get_page(1),
        "has_intervals": True,
        "has_one_whisker": True,
        "is_log": False,
        "can_compare": False,
        "reason": "",
        "floor": "",
    }
    edition = Edition(number=1, unit="day", n_units=40)
    board = Board(
        split=Split(name="test", title="Test"),
        edition=edition,
        entries=(),
        unfiltered=(row(1).entry,) * 1_234,
    )
    return legend(board, BoardTable(**table | changes), ladder=ladder)


def test_marks_of_a_table_without_ranges_name_the_band() -> None:
    assert drawn().marks == (
        "Lower is better. <strong>Bold</strong>: best, <u>underlined</u>: second best"
        '<span class="interval">, band: interval of the best</span>.'
    )


def test_marks_of_a_table_without_intervals_are_bold_and_underlined_alone() -> None:
    assert drawn(has_intervals=False).marks == (
        "Lower is better. <strong>Bold</strong>: best, <u>underlined</u>: second best."
    )


def test_marks_of_filtered_rows_are_of_all_rows() -> None:
    marks = drawn(query=BoardQuery(filters=Filters({"frames": 2}))).marks
    assert "<strong>Bold</strong>: best of all 1,234, <u>" in marks


@pytest.mark.parametrize(("highs", "is_shown"), [((2, 2), True), ((1, 2), False)])
def test_marks_name_rank_ranges_where_a_rank_is_uncertain(highs: tuple[int, int], *, is_shown: bool) -> None:
    lows = (1, 1) if is_shown else (1, 2)
    rows = tuple(row(i, low=lows[i - 1], high=highs[i - 1]) for i in (1, 2))
    ladder = rank_ladder([each.entry for each in rows], primary="mid")
    marks = drawn(rows=rows, ladder=ladder).marks
    assert '<span class="with-best-sample">grey</span>: may be the best (95% confidence)' in marks
    assert ("95% rank range" in marks) == is_shown
    assert "band" not in marks


def test_marks_name_the_day_since_which_ranks_have_moved() -> None:
    marks = drawn(moved_since=datetime(2026, 10, 29, 23, 59, 59, 999_999, tzinfo=UTC)).marks
    assert marks.endswith(', ▲▼: moved since <time datetime="2026-10-29">2026-10-29</time>.')


def test_drawings_with_intervals_are_explained_with_their_unit_and_scale() -> None:
    assert drawn().drawings == (
        "The tick is the value, the bar its 95% confidence interval (bootstrap over 40 days). "
        "The vertical grey band is the interval of the best method. An arrow: the value is off the scale."
    )
    assert "(bootstrap over 40 days), on a logarithmic scale." in drawn(is_log=True).drawings


def test_drawings_beside_quoted_rows_explain_rings() -> None:
    assert drawn(sources=[SOURCE]).drawings.endswith(
        "off the scale. Rings are values quoted from papers. They have no confidence interval, "
        "because papers report no values per recording."
    )


def test_drawings_of_quoted_rows_alone_are_rings() -> None:
    alone = drawn(has_intervals=False, is_log=True, sources=[SOURCE]).drawings
    assert alone.startswith("A ring is the value quoted from a paper, on a logarithmic scale. Papers report")
    assert drawn(has_intervals=False).drawings == ""


def test_rank_ranges_are_explained_with_and_without_quoted_rows() -> None:
    rows = (row(1, low=1, high=2),)
    assert drawn(rows=rows).rank_ranges == (
        "(a–b) below a rank: the true rank is between a and b (95% confidence). "
        "No range: only this rank is possible (95% confidence). "
        "With 95% confidence, the best of a column is one of its grey values."
    )
    quoted = drawn(rows=rows, sources=[SOURCE]).rank_ranges
    assert (
        "rows quoted from papers never have a range. For this, a value quoted from a paper counts as if it "
        "had a confidence interval as wide as that of the submission. With"
    ) in quoted
    assert quoted.endswith("one of its grey values, or a row quoted from a paper.")


@pytest.mark.parametrize("has_intervals", [True, False])
def test_rank_ranges_are_not_explained_where_no_row_has_one(*, has_intervals: bool) -> None:
    assert drawn(has_intervals=has_intervals).rank_ranges == ""
    without = drawn(has_intervals=False, rows=(row(1, low=1, high=2),))
    assert without.rank_ranges == ""


def test_ttc_ranges_have_their_numbers_of_sequences_where_these_are_known() -> None:
    names = [each.name for each in RULES.ranges]
    counted = drawn(counts=dict.fromkeys(names, 1_500)).ttc_ranges
    assert counted.startswith("TTC ranges by the true time to contact (number of sequences): <span>")
    assert counted.count(" (1,500)</span>") == len(names)
    unknown = drawn().ttc_ranges
    first = RULES.ranges[0]
    assert unknown.startswith(
        f"TTC ranges by the true time to contact: <span>{first.seconds} {first.name}</span>, <span>"
    )
    assert unknown.endswith("</span>.")
