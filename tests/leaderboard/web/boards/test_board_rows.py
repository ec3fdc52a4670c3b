"""What a board's template is given: its numbers, its rows, its heads."""

from dataclasses import replace
from typing import Any

import pytest
from django.utils.safestring import SafeString

from leaderboard.boards.rows import Entry
from leaderboard.models import Edition, Split, Visibility
from leaderboard.web.boards.board_views import _listed
from leaderboard.web.boards.score_columns import MARKED, Cell, Group, Heading
from leaderboard.web.boards.tables import _why_no_interval
from tests.leaderboard.web.boards.test_legend import row

ENTRY = Entry(kind="submission", method="M", team="T", scores={"mid": 1.0}, rank=3)
INTERVAL = "95% confidence interval: 1.00 to 2.00"


@pytest.mark.parametrize(
    ("cell", "hint", "remarks"),
    [
        (Cell("1.50"), "", []),
        (Cell("1.50", is_with_best=True), MARKED, [MARKED]),
        (Cell("1.50", interval="1.00 to 2.00"), INTERVAL, ["1.00 to 2.00"]),
        (
            Cell("1.50", interval="1.00 to 2.00", is_with_best=True),
            f"{INTERVAL}; {MARKED}",
            [MARKED, "1.00 to 2.00"],
        ),
    ],
)
def test_number_says_its_interval_and_mark(cell: Cell, hint: str, remarks: list[str]) -> None:
    assert (cell.hint, cell.remarks) == (hint, remarks)


def test_interval_beside_a_number_is_read_once() -> None:
    beside = Cell("1.50", interval="1.00 to 2.00", whisker=SafeString("<svg></svg>"))
    assert (beside.interval_hint, beside.hint, beside.remarks) == (INTERVAL, INTERVAL, [])


def test_group_of_one_column_leaves_its_symbol_out() -> None:
    group = Group(name="Warning error", title="Warning error (WE)", symbol="WE", unit="%", n_columns=2)
    assert group.heading == "Warning error (WE)"
    assert replace(group, n_columns=1).heading == "Warning error"


def test_heading_without_a_group_has_its_unit_or_its_metric_below() -> None:
    overall = Heading("mid", "MiD", "", "", is_overall=True, unit="10⁻⁴", metric="MiD")
    assert overall.below == "10⁻⁴"
    assert replace(overall, symbol="0–3 s", is_overall=False).below == "MiD"


@pytest.mark.parametrize(
    ("changes", "rank", "shown_to"),
    [
        ({}, "3", ""),
        ({"rank": None}, "–", ""),
        ({"is_mine": True}, "3", ""),
        ({"is_mine": True, "pseudonym": "Foo"}, "3", "shown as Foo"),
        ({"pseudonym": "Foo"}, "3", ""),
        ({"is_mine": True, "visibility": Visibility.PRIVATE}, "(3)", "private, would be rank 3"),
        ({"is_mine": True, "visibility": Visibility.PRIVATE, "rank": None}, "–", "private"),
        # As the maintainers see it.
        ({"visibility": Visibility.PRIVATE}, "(3)", ""),
    ],
)
def test_row_says_its_rank_and_to_its_team_who_sees_it(
    changes: dict[str, Any], rank: str, shown_to: str
) -> None:
    shown = replace(row(3), entry=replace(ENTRY, **changes))
    assert (shown.rank, shown.shown_to) == (rank, shown_to)


@pytest.mark.parametrize(("moved", "direction"), [(2, "up"), (-1, "down")])
def test_row_says_where_it_has_moved(moved: int, direction: str) -> None:
    assert replace(row(3), moved=moved).direction == direction


def test_value_without_an_interval_says_why() -> None:
    edition = Edition(unit="day", n_units=40)
    quoted = replace(ENTRY, source="Shi (2023).")
    assert _why_no_interval(quoted, edition).endswith("papers do not report values per recording")
    assert _why_no_interval(ENTRY, edition) == (
        "No confidence interval: too few days, or too few with an error"
    )


@pytest.mark.parametrize(
    ("titles", "sentence"),
    [
        ([], ""),
        (["Test"], "Test"),
        (["Test", "Demo"], "Test and Demo"),
        (["Test", "Demo", "Val"], "Test, Demo and Val"),
    ],
)
def test_splits_of_a_sentence_have_what_follows_them(titles: list[str], sentence: str) -> None:
    listed = _listed([Split(name=title, title=title) for title in titles])
    assert " ".join(f"{split.title}{separator}" for split, separator in listed) == sentence
