"""One table: columns of published values, their ranks, and the marks for best and second."""

import pytest

from evaluator.metrics.registry import best_and_second, rank

Column = list[float | None]

TABLE: list[tuple[Column, list[int | None], set[int], set[int]]] = [
    ([], [], set(), set()),
    ([14.8], [1], {0}, set()),
    ([None], [None], set(), set()),
    ([None, None], [None, None], set(), set()),
    ([14.8, 14.3], [2, 1], {1}, {0}),
    ([14.3, None, 14.8], [1, None, 2], {0}, {2}),
    ([1.0, 2.0, 2.0, 3.0], [1, 2, 2, 4], {0}, {1, 2}),
    ([2.0, 1.0, 1.0, 3.0], [3, 1, 1, 4], {1, 2}, {0}),
    ([1.0, 1.0, 1.0], [1, 1, 1], {0, 1, 2}, set()),
    ([3.0, 1.0, 3.0, 1.0, 2.0, None], [4, 1, 4, 1, 3, None], {1, 3}, {4}),
    ([0.0, -0.0, 5.0], [1, 1, 3], {0, 1}, {2}),
    ([213.9, 200.8, 41.0, 14.4, 14.3], [5, 4, 3, 2, 1], {4}, {3}),
]


@pytest.mark.parametrize(("values", "ranks", "best", "second"), TABLE)
def test_ties_share_ranks_and_marks_and_the_unscored_have_none(
    values: Column, ranks: list[int | None], best: set[int], second: set[int]
) -> None:
    assert rank(values) == ranks
    assert best_and_second(values) == (frozenset(best), frozenset(second))


def test_nothing_that_is_no_number_can_be_ranked() -> None:
    with pytest.raises(ValueError, match="NaN has no rank"):
        rank([1.0, float("nan")])
    with pytest.raises(ValueError, match="NaN has no rank"):
        best_and_second([float("nan")])
