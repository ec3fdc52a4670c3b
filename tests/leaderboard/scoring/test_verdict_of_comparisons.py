"""The verdict over a comparison, in words: what the best is significantly better than."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from leaderboard.boards.rows import Entry
from leaderboard.scoring.comparisons import Compared, Difference, Pair
from leaderboard.web.boards import compare_tables

A, B, C = (
    Entry(kind="submission", method=name, team="T", scores={"mid": value})
    for name, value in (("A", 10.0), ("B", 12.0), ("C", 14.0))
)


def compared(p_of_b: float, p_of_c: float, *, reason: str = "") -> Compared:
    def pair(first: Entry, second: Entry, p: float) -> Pair:
        return Pair(first, second, {"mid": Difference(-2.0, -3.0, -1.0, p)})

    pairs = (pair(A, B, p_of_b), pair(A, C, p_of_c), pair(B, C, 0.5))
    nothing = cast("Any", SimpleNamespace(unit="recording"))
    return Compared(nothing, nothing, (A, B, C), pairs, is_complete=True, reason=reason)


@pytest.mark.parametrize(
    ("p_of_b", "p_of_c", "said"),
    [
        (0.001, 0.001, "it is significantly better than B and C."),
        (0.4, 0.4, "it is not significantly better than B and C."),
        (0.4, 0.001, "it is significantly better than C, and not significantly better than B."),
    ],
)
def test_the_best_of_three_is_named_with_those_that_it_is_significantly_better_than(
    p_of_b: float, p_of_c: float, said: str
) -> None:
    sentence = compare_tables.verdict(compared(p_of_b, p_of_c))
    assert sentence == f"Of these three, A has the lowest MiD, 10.00. On these recordings {said}"


def test_with_too_few_recordings_nothing_is_claimed() -> None:
    sentence = compare_tables.verdict(compared(0.001, 0.001, reason="There are 12 recordings."))
    assert sentence.endswith("There are too few recordings for confidence intervals and p-values.")
