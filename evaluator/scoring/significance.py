"""Significance: the bounds, and the words for what falls short of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final

from evaluator.units import RECORDING, in_words

SIGNIFICANT: Final = 0.05
P_CLASSES: Final = (0.001, 0.01, SIGNIFICANT)
"""Below which of these a p lies is told where the p itself is not."""

MIN_DEGREES: Final = 8.0
"""With fewer degrees of freedom nothing is said of a mean: too few units to know how much they vary."""

# Of the normal distribution's 97.5 % point: what a difference must be to be found with a power of 80 %.
_DETECTABLE: Final = (1.959964 + 0.841621) / 1.959964


def p_below(p: float) -> float:
    """The smallest of `P_CLASSES` that `p` is below, else 1. Of p as it was computed, never of a rounded one.

    >>> p_below(0.0004), p_below(0.0496), p_below(0.05)
    (0.001, 0.05, 1.0)
    """
    return next((bound for bound in P_CLASSES if p < bound), 1.0)


@dataclass(frozen=True, slots=True)
class Difference:
    """First minus second in one column: below 0 the first is better. Computed here or told by a server.

    `low` and `high` are its 95 % interval, `p` is the two-sided cluster sign-flip test's; None where there
    are too few units. `p_below` is the smallest of `P_CLASSES` that p is below, else 1: it is what judges,
    alone where p is not told, and follows from p where it is not given. `n_effective` is the effective number
    of units, and `unit` what these are: recording, day or given.
    """

    difference: float
    low: float | None = None
    high: float | None = None
    p: float | None = None
    p_below: float | None = None
    n_effective: float | None = None
    unit: str = field(default=RECORDING, repr=False)

    def __post_init__(self) -> None:
        """Give `p_below` where p says it."""
        if self.p_below is None and self.p is not None:
            object.__setattr__(self, "p_below", p_below(self.p))

    @property
    def is_significant(self) -> bool:
        """Whether p is below 5 %: of this column alone, whatever else was looked at."""
        return self.p_below is not None and self.p_below <= SIGNIFICANT

    @property
    def detectable_difference(self) -> float | None:
        """The smallest difference that four of five such tests would have found (80 % power).

        1.43 half widths of the 95 % confidence interval: (z of 97.5 % + z of 80 %) / z of 97.5 %. None for a
        difference that is significant, and where there is no interval.
        """
        if self.low is None or self.high is None or self.is_significant:
            return None
        return _DETECTABLE * (self.high - self.low) / 2

    def turned(self) -> Difference:
        """The same seen from the other side: second minus first."""
        low = None if self.high is None else 0.0 - self.high
        high = None if self.low is None else 0.0 - self.low
        return replace(self, difference=0.0 - self.difference, low=low, high=high)


def too_few_units(n_effective: float | None, *, unit: str = RECORDING) -> str:
    """Why there is no interval and no p.

    >>> too_few_units(5.34)
    'too few recordings (effective number 5.3; at least 8 needed)'
    >>> too_few_units(7.99, unit="day")
    'too few days (effective number 7.9; at least 8 needed)'
    >>> too_few_units(None)
    'too few recordings'
    """
    few = f"too few {in_words(unit)}"
    if n_effective is None:
        return few
    return f"{few} (effective number {cut_off(n_effective):.1f}; at least {MIN_DEGREES:g} needed)"


def cut_off(n_effective: float) -> float:
    """An effective number with one decimal, not rounded: what is too few never reads as enough."""
    return math.floor(10 * n_effective) / 10
