"""What the pages of charts say around them, and the tables that hold the same numbers."""

from dataclasses import replace

import pytest

from evaluator.tables.published import printed_tables
from leaderboard.boards.listing import Board
from leaderboard.boards.rows import Entry
from leaderboard.models import Split, Visibility
from leaderboard.web.charts.chart_options import Chart
from leaderboard.web.charts.chart_views import N_PROFILES, _cell_words, _public, profile, profile_note
from leaderboard.web.charts.paper_charts import MAX_TOGETHER, _about, _row_groups

TABLES = {shown.table.name: shown for shown in printed_tables()}


def chart(*, has_intervals: bool = False, numbers: tuple[int, ...] = ()) -> Chart:
    return Chart(
        kind="profile",
        label="",
        options={},
        columns=("Method", "Range", "MiD"),
        rows=(("A", "0–3 s", "14.3"), ("B", "0–3 s", "15.1")),
        numbers=numbers,
        has_intervals=has_intervals,
    )


def board(n_public: int) -> Board:
    entries = [
        Entry(kind="submission", method=f"M{i}", team="T", scores={"mid": float(i)}, rank=i)
        for i in range(1, n_public + 1)
    ]
    own = Entry(
        kind="submission", method="Own", team="T", scores={"mid": 0.5}, rank=1, visibility=Visibility.PRIVATE
    )
    return Board(split=Split(name="test"), edition=None, entries=(), unfiltered=(own, *entries))


@pytest.mark.parametrize(
    ("n_public", "methods"),
    [(N_PROFILES, "All methods"), (N_PROFILES + 1, f"The first {N_PROFILES} methods")],
)
def test_note_of_a_profile_says_which_public_methods_it_has(n_public: int, methods: str) -> None:
    assert profile_note(board(n_public), chart()) == (
        f"{methods} on the board. "
        "Do not compare MiD across ranges: at short TTC the image changes faster, so MiD is larger."
    )


def test_note_of_a_profile_names_intervals_where_it_has_some() -> None:
    note = profile_note(board(2), chart(has_intervals=True))
    assert note.startswith("All methods on the board, with 95% confidence intervals where available.")


def test_profile_has_the_first_public_rows_by_rank_then_name_and_last_those_without_a_rank() -> None:
    def row(method: str, rank: int | None) -> Entry:
        value = None if rank is None else float(rank)
        return Entry(kind="submission", method=method, team="T", scores={"mid": value}, rank=rank)

    rows = [row("Z", None), row("b", 2), row("A", 2), row("y", None), row("C", 1)]
    unfiltered = (*rows, replace(row("Own", 1), visibility=Visibility.PRIVATE))
    shown = Board(split=Split(name="test"), edition=None, entries=(), unfiltered=unfiltered)
    assert profile(shown).columns[2:] == ("C", "A", "b")
    assert [entry.method for entry in _public(shown)] == ["C", "A", "b", "y", "Z"]


@pytest.mark.parametrize(
    ("n_first", "column"), [(0, "the column."), (20, "the column, for the first 20 submissions.")]
)
def test_map_of_pairs_says_what_a_cell_is(n_first: int, column: str) -> None:
    expected = f"Each cell: MiD of the row minus MiD of {column} Negative: the row is better."
    assert _cell_words("MiD", n_first=n_first) == expected


def test_table_of_a_chart_aligns_its_numbers_and_names_its_first_column() -> None:
    drawn = chart(numbers=(2,))
    assert drawn.headings == [("Method", ""), ("Range", ""), ("MiD", "number")]
    assert drawn.table_rows[1] == [("B", "first"), ("0–3 s", ""), ("15.1", "number")]


def test_table_of_a_chart_that_begins_with_a_number_has_no_first_name() -> None:
    assert [css for _, css in chart(numbers=(0, 2)).table_rows[0]] == ["number", "", "number"]


def test_rows_of_the_paper_stand_together_by_split() -> None:
    groups = _row_groups(TABLES["main-results"])
    splits = [{cells[0].text for _, cells in rows} for rows in groups]
    assert splits == [{split} for split in dict.fromkeys(row.cells[0] for row in TABLES["main-results"].rows)]
    assert len(splits) > 1
    assert sum(map(len, groups)) == len(TABLES["main-results"].rows)


@pytest.mark.parametrize("name", TABLES)
def test_cells_of_the_paper_are_numbers_or_texts_and_mark_the_default_once(name: str) -> None:
    shown = TABLES[name]
    for is_default, cells in [row for rows in _row_groups(shown) for row in rows]:
        assert [cell.heading for cell in cells] == list(shown.headings)
        assert sum(cell.is_default for cell in cells) == is_default
        for i, cell in enumerate(cells):
            is_number = shown.table.is_result and i >= shown.n_names
            assert (cell.css == "number") == is_number
            assert cell.is_long == (len(cell.text) > MAX_TOGETHER)
            assert not cell.is_best or is_number


def test_table_of_the_paper_says_its_section_then_its_units() -> None:
    about = _about(TABLES["main-results"])
    assert about.startswith(f"{TABLES['main-results'].section}. ")
    assert about.endswith("lower is better.")
