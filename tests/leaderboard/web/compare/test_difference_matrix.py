"""Several methods compared, without a page: the matrix, the forest plot, the verdict and the contact lens."""

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast
from uuid import UUID

import pytest

from leaderboard.boards.rows import ConfidenceInterval, Entry
from leaderboard.statistics.comparisons import Compared, Difference, Pair
from leaderboard.web.charts import svg
from leaderboard.web.charts.profile_chart import distinct_names
from leaderboard.web.charts.range_leaders import listed, range_leaders
from leaderboard.web.compare import compare_tables, contact_lens, difference_matrix

NAMES = ("Near", "Middle", "Far")
ENTRIES = tuple(
    Entry(kind="published", slug=name, method=name, team=name[0], scores={"mid": value}, decimals=1)
    for name, value in zip(NAMES, (10.0, 12.0, 15.5), strict=True)
)


def difference(first: Entry, second: Entry, *, p: float | None = 0.001, half: float = 0.5) -> Difference:
    value = first.value - second.value
    return Difference(value, value - half, value + half, p) if p is not None else Difference(value)


def compared(
    *p: float | None, entries: Sequence[Entry] = ENTRIES, half: float = 0.5, **fields: Any
) -> Compared:
    """All pairs of the entries, each with its p, or without a test."""
    pairs = [
        Pair(first, second, {"mid": difference(first, second, p=each, half=half)})
        for (first, second), each in zip(itertools.combinations(entries, 2), p, strict=True)
    ]
    world = cast("Any", SimpleNamespace(unit="recording", split=None))
    options = {"is_complete": True, "reason": "", **fields}
    return Compared(world, world, tuple(entries), tuple(pairs), **options)


def texts(matrix: difference_matrix.Matrix) -> list[list[str]]:
    return [[cell.text for cell in cells] for _, cells in matrix.rows]


# --- the matrix -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_rows_and_columns_go_from_the_best_to_the_worst_and_mirror_each_other(order: Sequence[int]) -> None:
    matrix = difference_matrix.difference_matrix(
        compared(0.001, 0.001, 0.001, entries=[ENTRIES[i] for i in order])
    )
    assert [entry.method for entry, _ in matrix.rows] == list(NAMES)
    assert texts(matrix) == [["", "−2.0", "−5.5"], ["+2.0", "", "−3.5"], ["+5.5", "+3.5", ""]]
    assert [[cell.css for cell in cells] for _, cells in matrix.rows] == [
        ["", "better", "better"], ["worse", "", "better"], ["worse", "worse", ""],
    ]  # fmt: skip
    assert matrix.rows[0][1][1].hint == "significantly better"
    assert matrix.rows[2][1][0].hint == "significantly worse"
    assert matrix.n_tested == 3


def test_pairs_without_significance_or_without_a_test_say_so_and_have_no_colour() -> None:
    matrix = difference_matrix.difference_matrix(compared(0.001, 0.6, None))
    assert [[cell.hint for cell in cells] for _, cells in matrix.rows] == [
        ["", "significantly better", "not significant"],
        ["significantly worse", "", "no test"],
        ["not significant", "no test", ""],
    ]
    assert {cell.css for _, cells in matrix.rows for cell in cells if cell.hint[:2] == "no"} == {""}
    assert matrix.n_tested == 2


def test_two_methods_or_an_incomplete_comparison_have_no_matrix() -> None:
    assert difference_matrix.difference_matrix(compared(0.001, entries=ENTRIES[:2])) is None
    assert difference_matrix.difference_matrix(compared(0.001, 0.001, 0.001, is_complete=False)) is None
    assert compare_tables.verdict(compared(0.001, 0.001, 0.001, is_complete=False)) == ""


def test_the_forest_has_each_other_method_against_the_best_on_one_scale() -> None:
    matrix = difference_matrix.difference_matrix(compared(0.001, 0.6, 0.001))
    rows = [(row.entry.method, row.interval, row.p) for row in matrix.forest]
    assert rows == [
        ("Near", "best", ""), ("Middle", "+1.5 to +2.5", "0.0010"), ("Far", "+5.0 to +6.0", "0.6000"),
    ]  # fmt: skip
    # None is better than the best: the scale begins at 0 and ends above the largest end.
    ends = [drawn_at(row.drawing) for row in matrix.forest]
    assert [each["circle"] for each in ends] == [
        [3.0],
        [pytest.approx(3 + 94 * 2 / 6, abs=0.1)],
        [pytest.approx(3 + 94 * 5.5 / 6, abs=0.1)],
    ]
    assert {tuple(each["zero"]) for each in ends} == {(3.0, 3.0)}


def test_the_forest_begins_below_zero_where_an_interval_does() -> None:
    matrix = difference_matrix.difference_matrix(compared(0.6, 0.6, 0.6, half=3.0))
    middle = drawn_at(matrix.forest[1].drawing)
    assert middle["zero"][0] > 3.0
    low, high = middle["interval"][:2]
    assert low < middle["zero"][0] < middle["circle"][0] < high
    assert middle["circle"][0] == pytest.approx((low + high) / 2, abs=0.1)


def test_the_forest_is_empty_where_nothing_was_tested() -> None:
    matrix = difference_matrix.difference_matrix(compared(None, None, None))
    assert (matrix.forest, matrix.axis, matrix.n_tested) == ((), "", 0)


def drawn_at(drawing: str) -> dict[str, list[float]]:
    """Where the line at 0, the interval and the dot are, in percent."""

    def numbers(pattern: str) -> list[float]:
        return [
            float(x) for tag in re.findall(pattern, drawing) for x in re.findall(r'x[12]?="([\d.]+)%"', tag)
        ]

    return {
        "zero": numbers(r'<line class="zero"[^>]*>'),
        "interval": numbers(r'<line x1[^>]*y1="7"[^>]*>'),
        "circle": [float(x) for x in re.findall(r'cx="([\d.]+)%"', drawing)],
    }


# --- drawings ---------------------------------------------------------------------------------------------


def test_a_difference_is_drawn_between_the_ends_of_its_scale() -> None:
    drawn = drawn_at(svg.difference(10.0, 5.0, -10.0, 10.0))
    assert drawn == {"zero": [50.0, 50.0], "interval": [3.0, 97.0], "circle": [73.5]}
    assert 'class="dot"' in svg.difference(10.0, 5.0, -10.0, 10.0)
    ring = svg.difference(10.0, 0.0, None, None)
    assert 'class="ring"' in ring
    assert drawn_at(ring) == {"zero": [50.0, 50.0], "interval": [], "circle": [50.0]}


def test_an_axis_has_its_stops_where_differences_on_it_are_drawn() -> None:
    axis = svg.axis(10.0)
    assert re.findall(r'<line x1="([\d.]+)%" x2="\1%" y1="11"', axis) == ["3", "50", "97"]
    assert re.findall(r">([^<>]+)</text>", axis) == ["−10", "0", "10"]
    assert '<line x1="3%" x2="97%" y1="14"' in axis
    assert re.findall(r">([^<>]+)</text>", svg.axis(9.0, start=-3.0)) == ["0", "9"]
    assert re.findall(r">([^<>]+)</text>", svg.axis(9.0, start=-3.1)) == ["−3.1", "0", "9"]


@pytest.mark.parametrize(
    ("values", "end"),
    [([-3.2, 1.0], 4.0), ([3.9], 4.0), ([4.0], 4.0), ([], 1.0), ([0.0], 1.0), ([0.07], 0.08), ([41.0], 60.0)],
)
def test_a_scale_ends_at_a_round_number_that_no_value_exceeds(values: list[float], end: float) -> None:
    assert svg.scale_end(values) == end


# --- the verdict ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("p", "sentence"),
    [
        ((0.001, 0.001, 0.9), "It is significantly better than the other two"),
        ((0.9, 0.9, 0.001), "It is not significantly better than the other two"),
        ((0.9, 0.001, 0.9), "It is significantly better than Far, and not significantly better than Middle"),
    ],
)
def test_the_verdict_is_about_the_best_whatever_the_order(p: Sequence[float], sentence: str) -> None:
    text = compare_tables.verdict(compared(*p))
    assert text.startswith("Of these three, Near has the lowest MiD, 10.0.")
    assert f"{sentence} (corrected for all 3 pairs)." in text
    turned = compare_tables.verdict(compared(*reversed(p), entries=ENTRIES[::-1]))
    assert sentence in turned or sentence.replace("the other two", "") in turned


@pytest.mark.parametrize(("n", "word"), [(2, "Two"), (3, "Three"), (4, "Four"), (5, "Five")])
def test_title_and_verdict_count_the_methods_and_a_single_pair_stands_alone(n: int, word: str) -> None:
    entries = [
        replace(ENTRIES[0], method=f"M{i}", slug=f"m{i}", scores={"mid": 10.0 + i}, method_id=UUID(int=i + 1))
        for i in range(n)
    ]
    made = compared(*[0.001] * (n * (n - 1) // 2), entries=entries)
    edition = SimpleNamespace(unit="recording", unit_noun="recording", units="9 recordings")
    world = replace(made, split=cast("Any", SimpleNamespace(is_hidden=False)), edition=cast("Any", edition))
    tried = {UUID(int=1): 3}
    page = compare_tables.comparison(world, n_tried=tried)
    assert page["title"] == f"{word} methods compared"
    assert (page["only_pair"] is page["pairs"][0]) is (n == 2)
    assert (page["matrix"] is None) is (n == 2)
    assert "M0</b> is the best of 3 scored submissions" in page["selection"].replace("strong>", "b>")
    assert page["metric"].symbol == "MiD"
    if n > 2:
        assert f"Of these {word.lower()}, " in page["verdict"]
    else:
        assert page["verdict"] == page["pairs"][0]["sentence"]
    for pair in page["pairs"]:
        [group] = pair["groups"]
        [row] = group["rows"]
        both = (pair["pair"].first, pair["pair"].second)
        assert (row["first"], row["second"]) == tuple(f"{each.value:.1f}" for each in both)
        assert row["interval"] == difference_matrix.interval_of(pair["pair"].difference, decimals=1)
        assert pair["has_intervals"]


def test_verdict_of_too_few_recordings_says_so_and_of_withheld_pairs_why_once() -> None:
    few = compare_tables.verdict(compared(None, None, None, reason="few"))
    assert few == (
        "Of these three, Near has the lowest MiD, 10.0. "
        "There are too few recordings for confidence intervals and p-values."
    )
    made = compared(0.001, None, None)
    pairs = [made.pairs[0], *(replace(pair, withheld="It is secret.") for pair in made.pairs[1:])]
    text = compare_tables.verdict(replace(made, pairs=tuple(pairs)))
    assert text.endswith("It is significantly better than Middle. It is secret.")


def test_verdict_tells_what_is_better_among_these_methods_alone() -> None:
    ends = ((1, 3), (1, 3), (1, 3))
    entries = [
        replace(entry, intervals={"mid": ConfidenceInterval(rank_low=low, rank_high=high)})
        for entry, (low, high) in zip(ENTRIES, ends, strict=True)
    ]
    told = (
        " Among these three, it is significantly better than {0}{1}; among all pairs of the board it is not, "
        "and {0} may be the best."
    )
    both = compare_tables.verdict(compared(0.001, 0.001, 0.9, entries=entries))
    assert both.endswith(told.format("Middle and Far", " (corrected for all 3 pairs)"))
    one = compare_tables.verdict(compared(0.9, 0.001, 0.9, entries=entries))
    assert "It is not significantly better than Middle (corrected for all 3 pairs)." in one
    assert one.endswith(told.format("Far", ""))


def test_ranges_that_do_not_meet_on_the_board_are_significant_and_a_possibly_best_one_is_so_here_alone() -> (
    None
):
    def with_ranges(*ends: tuple[int, int]) -> list[Entry]:
        return [
            replace(entry, intervals={"mid": ConfidenceInterval(rank_low=low, rank_high=high)})
            for entry, (low, high) in zip(ENTRIES, ends, strict=True)
        ]

    apart = difference_matrix.findings(compared(0.9, 0.9, 0.9, entries=with_ranges((1, 1), (2, 3), (2, 3))))
    assert [(pair.first.method, pair.second.method) for pair in apart.significant] == [
        ("Near", "Middle"), ("Near", "Far"),
    ]  # fmt: skip
    meeting = difference_matrix.findings(
        compared(0.001, 0.001, 0.9, entries=with_ranges((1, 2), (1, 3), (2, 3)))
    )
    assert [pair.second.method for pair in meeting.here_alone] == ["Middle"]
    assert [pair.second.method for pair in meeting.significant] == ["Far"]


# --- the contact lens -------------------------------------------------------------------------------------


def curve(*errors: tuple[float, float, float | None]) -> list[Mapping[str, Any]]:
    return [{"low_s": low, "high_s": high, "rte": error} for low, high, error in errors]


def with_evaluation(number: int, **fields: Any) -> Entry:
    return replace(ENTRIES[number], evaluation_id=UUID(int=number + 1), **fields)


def test_the_lens_goes_from_far_to_near_with_an_error_of_each_method_that_has_one() -> None:
    entries = [with_evaluation(0), with_evaluation(1), with_evaluation(2)]
    curves = {
        UUID(int=1): curve((-4, -2, 9), (0, 2, 10), (2, 6, 50)),
        UUID(int=2): curve((2, 6, 100), (0, 2, None)),
    }
    lens = contact_lens.contact_lens(entries, curves)
    assert [entry.method for entry in lens.entries] == ["Near", "Middle"]
    assert [(step.low_s, step.high_s, step.errors_s) for step in lens.steps] == [
        (2, 6, (2.0, 4.0)), (0, 2, (0.1, None)),
    ]  # fmt: skip
    assert lens.steps[1].errors == [(0.1, pytest.approx(0.1 * 80 / 3.6)), (None, None)]


def test_fewer_than_two_curves_are_no_lens_and_a_masked_one_is_none_for_others() -> None:
    curves = {UUID(int=number): curve((0, 2, 10)) for number in (1, 2, 3)}
    two = [with_evaluation(0), with_evaluation(1)]
    assert contact_lens.contact_lens(two, curves) is not None
    assert contact_lens.contact_lens(two[:1], curves) is None
    assert contact_lens.contact_lens([*two[:1], ENTRIES[1]], curves) is None
    masked = with_evaluation(1, visibility="ANONYMOUS")
    assert contact_lens.contact_lens([two[0], masked], curves) is None
    assert contact_lens.contact_lens([two[0], replace(masked, is_mine=True)], curves) is not None
    assert contact_lens.contact_lens(two, dict.fromkeys(curves, curve((-2, -1, 10)))) is None


# --- words of charts --------------------------------------------------------------------------------------


def test_methods_of_one_name_are_told_apart_by_team_then_year_then_position() -> None:
    same = [replace(entry, method="Same") for entry in ENTRIES]
    assert distinct_names([*same[:2], ENTRIES[2]]) == ["Same (N)", "Same (M)", "Far"]
    of_team = [replace(entry, team="T", year=2020 + i) for i, entry in enumerate(same)]
    assert distinct_names(of_team) == ["Same (2020)", "Same (2021)", "Same (2022)"]
    assert distinct_names([replace(entry, year=2020) for entry in of_team]) == [
        "Same (1)", "Same (2)", "Same (3)",
    ]  # fmt: skip


def test_leaders_of_a_range_are_the_ranked_public_rows_that_are_best_there() -> None:
    names = ("mid", "mid_crucial", "mid_small")

    def row(number: int, *best: str, **fields: Any) -> Entry:
        scores = dict.fromkeys(names, 10.0 + number)
        return replace(ENTRIES[number], scores=scores, best=frozenset(best), **{"rank": 1, **fields})

    rules = SimpleNamespace(names_of=lambda metric: names, primary=SimpleNamespace(name="mid"))
    rows = [row(0, "mid", "mid_small"), row(1, "mid"), row(2, "mid", "mid_crucial", visibility="PRIVATE")]
    board = cast("Any", SimpleNamespace(entries=rows, rules=rules))
    assert [(methods, value) for _, methods, value in range_leaders(board)] == [
        ("Near and Middle", "10.0"), ("Near", "10.0"),
    ]  # fmt: skip
    board.entries = [row(0, "mid", rank=None)]
    assert range_leaders(board) == []


@pytest.mark.parametrize(
    ("names", "text"),
    [
        (["A"], "A"), (["A, fast"], "A, fast"), (["A", "B"], "A and B"),
        (["A, fast", "B"], "“A, fast” and “B”"),
        (["A", "B", "C"], "A, B and 1 other method"), (["A", "B", "C", "D"], "A, B and 2 other methods"),
    ],
)  # fmt: skip
def test_names_are_listed_up_to_two_and_the_rest_is_counted(names: list[str], text: str) -> None:
    assert listed(names) == text
