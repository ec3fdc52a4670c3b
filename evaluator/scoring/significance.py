"""When a number counts as known well enough: bounds, and the words for what falls short of them."""

from __future__ import annotations

import math
from typing import Final, Protocol

SIGNIFICANT: Final = 0.05
P_CLASSES: Final = (0.001, 0.01, SIGNIFICANT)
"""Below which of these a p lies is told where the p itself is not."""

MIN_DEGREES: Final = 8.0
"""With fewer degrees of freedom nothing is said of a mean: too few recordings to know how much they vary."""

# Of the normal distribution's 97.5 % point: what a difference must be to be found with a power of 80 %.
_DETECTABLE: Final = (1.959964 + 0.841621) / 1.959964


class Judged(Protocol):
    """Something that was tested."""

    @property
    def p_below(self) -> float | None:
        """The smallest of `P_CLASSES` that p is below, else 1; None where there is no p."""


class Interval(Judged, Protocol):
    """A tested difference with its 95 % confidence interval."""

    @property
    def low(self) -> float | None:
        """Its lower end."""

    @property
    def high(self) -> float | None:
        """Its upper end."""


def p_below(p: float) -> float:
    """The smallest of `P_CLASSES` that `p` is below, else 1. Of p as it was computed, never of a rounded one.

    >>> p_below(0.0004), p_below(0.0496), p_below(0.05)
    (0.001, 0.05, 1.0)
    """
    return next((bound for bound in P_CLASSES if p < bound), 1.0)


def is_significant(found: Judged) -> bool:
    """Whether p is below 5 %: of this column alone, whatever else was looked at."""
    return found.p_below is not None and found.p_below <= SIGNIFICANT


def detectable_difference(found: Interval) -> float | None:
    """The smallest difference that four of five such tests would have found (80 % power).

    1.43 half widths of the 95 % confidence interval: (z of 97.5 % + z of 80 %) / z of 97.5 %. None for a
    difference that is significant, and where there is no interval.
    """
    if found.low is None or found.high is None or is_significant(found):
        return None
    return _DETECTABLE * (found.high - found.low) / 2


def too_few_recordings(n_effective: float | None) -> str:
    """Why there is no interval and no p.

    >>> too_few_recordings(5.34)
    'too few recordings (effective number 5.3; at least 8 needed)'
    >>> too_few_recordings(7.99)
    'too few recordings (effective number 7.9; at least 8 needed)'
    >>> too_few_recordings(None)
    'too few recordings'
    """
    if n_effective is None:
        return "too few recordings"
    return (
        f"too few recordings (effective number {cut_off(n_effective):.1f}; at least {MIN_DEGREES:g} needed)"
    )


def cut_off(n_effective: float) -> float:
    """An effective number with one decimal, not rounded: what is too few never reads as enough."""
    return math.floor(10 * n_effective) / 10
