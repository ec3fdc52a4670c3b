"""Significance: the bounds, and the words for what falls short of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from statistics import NormalDist
from typing import Final

from evaluator.units import RECORDING, in_words

SIGNIFICANT: Final = 0.05
P_CLASSES: Final = (0.001, 0.01, SIGNIFICANT)
"""Below which of these a p lies is told where the p itself is not."""

LEAST_P: Final = 0.0001
"""The smallest p that the test can give: one in all of its sign flips, and the data itself."""

MIN_DEGREES: Final = 8.0
"""With fewer degrees of freedom nothing is said of a mean: too few units to know how much they vary."""

MIN_DIFFERENT: Final = 6
"""With fewer units that differ, or have an error, nothing is said: no sign flips give a p below 5%."""

# Of the normal distribution: the 97.5% point, and that plus the 80% point, for a power of 80%.
_TWO_SIDED: Final = 1.959964
_POWER: Final = 1.959964 + 0.841621


def p_below(p: float) -> float:
    """Return the smallest of `P_CLASSES` that the unrounded `p` is below, else 1.

    >>> p_below(0.0004), p_below(0.0496), p_below(0.05)
    (0.001, 0.05, 1.0)
    """
    return next((bound for bound in P_CLASSES if p < bound), 1.0)


@dataclass(frozen=True, slots=True)
class Influence:
    """The numbers of units to leave out until a difference changes; None if impossible.

    `n_to_undecided`: until it is insignificant, with enough units left for a test; `n_to_turn`: until it has
    the other sign, and `is_turn_significant` whether significantly.
    """

    n_units: int
    n_to_undecided: int | None = None
    n_to_turn: int | None = None
    is_turn_significant: bool = False


@dataclass(frozen=True, slots=True)
class Difference:
    """First score minus second in one column: below 0, the first is better.

    `low` and `high` bound its 95% interval, and `p` is from the two-sided sign-flip test; all are None if
    there are too few units, or fewer than 6 in which the two differ: `n_different` of `n_units`.
    `p_below` is the smallest of `P_CLASSES` above p, else 1; hidden splits show only this. `n_effective`
    is the effective number of units, `unit` is their kind (recording, day or given), and `influence` has
    the numbers of units without which the difference is not significant, or has the other sign.
    """

    difference: float
    low: float | None = None
    high: float | None = None
    p: float | None = None
    p_below: float | None = None
    n_effective: float | None = None
    influence: Influence | None = field(default=None, repr=False)
    unit: str = field(default=RECORDING, repr=False)
    n_different: int | None = field(default=None, repr=False)
    n_units: int | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if self.p_below is None and self.p is not None:
            object.__setattr__(self, "p_below", p_below(self.p))

    @property
    def is_significant(self) -> bool:
        """Whether p is below 5%, uncorrected for other columns."""
        return self.p_below is not None and self.p_below <= SIGNIFICANT

    @property
    def detectable_difference(self) -> float | None:
        """The difference detected with about 80% power; None if significant."""
        return None if self.is_significant else self.resolution

    @property
    def resolution(self) -> float | None:
        """The detectable difference also where it is significant: the resolution of the recordings.

        It is 1.43 half widths, and more where most units do not differ: there a larger difference comes with
        more units that differ, and so with more variance.
        """
        if self.low is None or self.high is None:
            return None
        error = (self.high - self.low) / 2 / _TWO_SIDED
        if self.n_different is None or self.n_units is None or 2 * self.n_different >= self.n_units:
            return _POWER * error
        # x = z √(V + x) for a number x of further units with one typical difference, V of which there are.
        a_unit = error / math.sqrt(self.n_different)
        return a_unit * (_POWER**2 / 2 + _POWER * math.sqrt(_POWER**2 / 4 + self.n_different))

    @property
    def why_untested(self) -> str:
        """Why there is neither interval nor p; empty where there is.

        >>> Difference(0.1, n_effective=700.0, n_different=2, n_units=700).why_untested
        'the methods differ in 2 of 700 recordings, too few to test (at least 6 needed)'
        """
        if self.p_below is not None:
            return ""
        if self.n_effective is None or self.n_effective < MIN_DEGREES:
            return too_few_units(self.n_effective, unit=self.unit)
        needed = f"too few to test (at least {MIN_DIFFERENT} needed)"
        if self.n_different is None or self.n_units is None:
            return f"the methods differ in few {in_words(self.unit)}, {needed}"
        return f"the methods differ in {self.n_different:,} of {in_words(self.unit, self.n_units)}, {needed}"

    def turned(self) -> Difference:
        """Swap first and second."""
        low = None if self.high is None else 0.0 - self.high
        high = None if self.low is None else 0.0 - self.low
        return replace(self, difference=0.0 - self.difference, low=low, high=high)


def best_of(n: int) -> float:
    """Compute the selection bias of the best of `n` equal variants, in standard errors of a difference.

    The mean of the largest of n normal variables, divided by √2.

    >>> [round(best_of(n), 2) for n in (1, 3, 10, 30, 100)]
    [0.0, 0.6, 1.09, 1.44, 1.77]
    """
    normal = NormalDist()
    # ∫ x n φ(x) Φ(x)^(n − 1) dx; beyond ±8 there is nothing.
    step = 1 / 128
    points = (i * step for i in range(-1024, 1025))
    return step * sum(x * n * normal.pdf(x) * normal.cdf(x) ** (n - 1) for x in points) / math.sqrt(2)


def significant_together(differences: Sequence[Difference]) -> list[bool]:
    """Test several differences together at 5% (Holm 1979).

    The smallest p is compared with 0.05 / m, the next with 0.05 / (m − 1), until one is not below. `p_below`
    replaces an unknown p; without either, a difference is not tested.

    >>> significant_together([Difference(-1, -2, -0.1, p) for p in (0.02, 0.01, 0.6)])
    [True, True, False]
    >>> significant_together([Difference(-1, -2, -0.1, p_below=below) for below in (0.01, 0.01, 1.0)])
    [True, True, False]
    """
    bounds = [each.p_below if each.p is None else each.p for each in differences]
    tested = sorted((p, i) for i, p in enumerate(bounds) if p is not None)
    apart = [False] * len(differences)
    for n_before, (p, i) in enumerate(tested):
        n_left = len(tested) - n_before
        is_below = n_left * p < SIGNIFICANT or (differences[i].p is None and n_left * p <= SIGNIFICANT)
        if not is_below:
            break
        apart[i] = True
    return apart


def too_few_units(n_effective: float | None, *, unit: str = RECORDING) -> str:
    """Explain why there is no interval and no p.

    >>> too_few_units(7.99, unit="day")
    'too few days (effective number 7.9; at least 8 needed)'
    """
    few = f"too few {in_words(unit)}"
    if n_effective is None:
        return few
    return f"{few} (effective number {cut_off(n_effective):.1f}; at least {MIN_DEGREES:g} needed)"


def cut_off(n_effective: float) -> float:
    """Format an effective number with one decimal, cut off: too few never reads as enough."""
    return math.floor(10 * n_effective) / 10
