"""Values to ranks. Lower is better; a missing value is never ranked. Rank the *published* values."""

from __future__ import annotations

import math
from collections.abc import Sequence


def rank(values: Sequence[float | None]) -> list[int | None]:
    """Competition ranks 1, 2, 2, 4: equal values share the rank, the next one counts those before it.

    >>> rank([14.8, 14.3, None, 14.8, 40.5])
    [2, 1, None, 2, 4]
    """
    first_rank: dict[float, int] = {}
    for position, value in enumerate(_ascending(values), 1):
        first_rank.setdefault(value, position)
    return [None if value is None else first_rank[value] for value in values]


def best_and_second(values: Sequence[float | None]) -> tuple[frozenset[int], frozenset[int]]:
    """Indices of the smallest and of the second smallest distinct value of one column; ties share the mark.

    >>> best, second = best_and_second([14.8, 14.3, None, 14.8])
    >>> sorted(best), sorted(second)
    ([1], [0, 3])
    """
    distinct = sorted(set(_ascending(values)))
    marks = [frozenset(i for i, value in enumerate(values) if value == wanted) for wanted in distinct[:2]]
    marks += [frozenset()] * (2 - len(marks))
    return marks[0], marks[1]


def _ascending(values: Sequence[float | None]) -> list[float]:
    given = [value for value in values if value is not None]
    if any(math.isnan(value) for value in given):
        raise ValueError("NaN has no rank; a missing value is None.")
    return sorted(given)
