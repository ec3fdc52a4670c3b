"""The map of pairs, without a page: what each cell says, and of which pairs the sentence above it speaks."""

import itertools
from dataclasses import replace
from typing import Any
from uuid import UUID

import pytest

from leaderboard.boards.rows import ConfidenceInterval, Entry
from leaderboard.statistics.comparisons import Difference, Pair
from leaderboard.web.charts.significance_chart import alike_words, significance


def entries(n: int) -> list[Entry]:
    return [
        Entry(
            kind="submission", method=f"M{i}", team="T", scores={"mid": 10.0 + i}, decimals=1, rank=i,
            method_id=UUID(int=i),
        )
        for i in range(1, n + 1)
    ]  # fmt: skip


def pairs(rows: list[Entry], *p: float | None) -> list[Pair]:
    """All pairs of the rows, with these p in turn; None: it is not computed yet."""
    values = itertools.cycle(p)
    made = []
    for first, second in itertools.combinations(rows, 2):
        value, gap = next(values), first.scores["mid"] - second.scores["mid"]
        differences = None if value is None else {"mid": Difference(gap, gap - 0.25, gap + 0.25, value)}
        made.append(Pair(first, second, differences))
    return made


def series_of(made: list[Pair]) -> dict[str, dict[str, Any]]:
    chart = significance(made, split="test")
    return {each["name"]: each for each in chart.options["baseOption"]["series"]}


def test_every_pair_has_a_cell_in_the_row_of_the_better_and_the_column_of_the_worse() -> None:
    # ECharts draws no cell without a third value.
    made = pairs(entries(4), 0.0005, 0.005, 0.02, 0.5, None, 0.0005)
    series = series_of(made)
    assert {name: [item["value"] for item in each["data"]] for name, each in series.items()} == {
        "p < 0.001": [[0, 0, 0], [2, 2, 0]],
        "p < 0.01": [[1, 0, 0]],
        "p < 0.05": [[2, 0, 0]],
        "not significant": [[1, 1, 0]],
        "computing…": [[2, 1, 0]],
    }
    assert [item["text"] for item in series["p < 0.001"]["data"]] == ["−1.0", "−1.0"]
    assert series["computing…"]["data"][0]["text"] == ""
    # Cells in the ink of the darkest class have light words; what is nearly the ground has a rim.
    inks = {name: each["label"]["color"] for name, each in series.items()}
    assert inks == {name: "--ground" if name == "p < 0.001" else "--ink" for name in series}
    rims = {name: each["itemStyle"]["borderColor"] for name, each in series.items()}
    assert rims == {name: "--doubt" if name == "computing…" else "--ground" for name in series}


def test_cell_reads_both_methods_their_difference_and_p_and_leads_to_their_comparison() -> None:
    [cell] = series_of(pairs(entries(2), 0.02))["p < 0.05"]["data"]
    assert [cell["name"], *cell["read"]] == [
        "1  M1 vs. 2  M2", "MiD −1.0 (−1.2 to −0.8)", "p 0.0200: p < 0.05",
    ]  # fmt: skip
    assert cell["href"] == f"/compare/?split=test&m={UUID(int=1)}&m={UUID(int=2)}"
    chart = significance(pairs(entries(2), 0.02), split="test")
    assert chart.rows == (("1  M1", "2  M2", "−1.0", "−1.2 to −0.8", "0.0200"),)
    assert [css for _, css in chart.headings] == ["", "", "number", "", "number"]
    [waiting] = series_of(pairs(entries(2), None))["computing…"]["data"]
    assert waiting["read"] == ["MiD computing…", "computing…"]


@pytest.mark.parametrize(("shown", "name"), [("PUBLIC", "no test"), ("ANONYMOUS", "no test (anonymous)")])
@pytest.mark.parametrize("which", ["first", "second"])
def test_pair_without_a_test_says_why_and_has_a_rim(shown: str, name: str, which: str) -> None:
    [made] = pairs(entries(2), 0.02)
    made = replace(
        made,
        differences={"mid": Difference(-1.0)},
        withheld="They are few.",
        **{which: replace(getattr(made, which), visibility=shown)},
    )
    series = series_of([made])[name]
    assert series["data"][0]["read"] == ["MiD −1.0", "They are few."]
    assert (series["itemStyle"]["borderColor"], series["z"]) == ("--quiet", 3)
    chart = significance([made], split="test")
    assert chart.rows[0][3:] == ("", "no test")
    assert ("not tested in pairs" in chart.note) is (shown == "ANONYMOUS")


@pytest.mark.parametrize(
    ("n", "is_low", "has_words"), [(6, True, True), (7, True, False), (8, True, False), (9, False, False)]
)
def test_map_of_few_is_low_and_shows_differences_also_on_a_phone(
    n: int, is_low: bool, has_words: bool
) -> None:
    chart = significance(pairs(entries(n), 0.02), split="test")
    assert chart.is_low is is_low
    wide, narrow, narrowest = (each["option"]["series"] for each in chart.options["media"])
    assert [each["label"]["show"] for each in (wide[0], narrow[0], narrowest[0])] == [True, *[has_words] * 2]
    [columns], [rows] = (chart.options["baseOption"][axis] for axis in ("xAxis", "yAxis"))
    assert columns["data"] == [str(rank) for rank in range(2, n + 1)]
    assert rows["data"] == [f"{rank}  M{rank}" for rank in range(1, n)]
    assert (columns["position"], rows["inverse"]) == ("top", True)
    assert f"first {n} methods" in chart.label


def test_without_pairs_there_is_neither_map_nor_sentence() -> None:
    assert significance([], split="test").rows == ()
    assert alike_words([]) == alike_words(pairs(entries(3), None)) == ""


@pytest.mark.parametrize(
    ("p", "words"),
    [
        ((0.001, 0.001, 0.001), "All tested pairs differ significantly (p < 0.05)."),
        (
            (0.001, 0.9, 0.001),
            "All tested pairs differ significantly (p < 0.05), except M1 (rank 1) and M3 (rank 3).",
        ),
        (
            (0.9, 0.9, 0.9),
            "All tested pairs differ significantly (p < 0.05), except M1 (rank 1) and M2 (rank 2); "
            "M1 (rank 1) and M3 (rank 3); M2 (rank 2) and M3 (rank 3).",
        ),
        (
            (0.001, None, None),
            "All pairs tested so far differ significantly (p < 0.05). Still computing: 2 pairs.",
        ),
    ],
)
def test_up_to_three_pairs_that_do_not_differ_are_named(p: tuple[float | None, ...], words: str) -> None:
    assert alike_words(pairs(ranged(entries(3)), *p)).replace("\u00a0", " ") == words


def ranged(rows: list[Entry], width: int = 0) -> list[Entry]:
    """The rows with a rank range of so many ranks besides their own."""
    return [
        replace(row, intervals={"mid": ConfidenceInterval(rank_low=row.rank, rank_high=row.rank + width)})
        for row in rows
    ]


def test_more_than_three_pairs_that_do_not_differ_are_counted() -> None:
    words = alike_words(pairs(entries(4), 0.9, 0.9, 0.9, 0.9, 0.001, None)).replace("\u00a0", " ")
    assert words == ("4 of 5 tested pairs do not differ significantly (p ≥ 0.05). Still computing: 1 pair.")


@pytest.mark.parametrize(("width", "overlap"), [(0, False), (1, True)])
def test_ranges_that_overlap_although_their_pairs_differ_are_explained(width: int, overlap: bool) -> None:
    words = alike_words(pairs(ranged(entries(2), width), 0.001))
    assert ("some of them still overlap" in words) is overlap
    # Where the pair is named as alike, nothing is to explain.
    assert "overlap" not in alike_words(pairs(ranged(entries(2), width), 0.9))
    assert "overlap" not in alike_words(pairs(entries(2), 0.001))
