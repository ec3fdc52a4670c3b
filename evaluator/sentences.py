"""What the differences of two methods mean, in words: the same on pages and on the command line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Protocol

from evaluator.protocol import INTERVAL_NAMES, SCORE_NAMES

SIGNIFICANT: Final = 0.05
_INTERVAL_WORDS: Final = {"overall": "", **{name: f" on {name}" for name in INTERVAL_NAMES[1:]}}
_METRIC_WORDS: Final = {"mid": ("MiD", ""), "rte": ("RTE", " percentage points")}


class Found(Protocol):
    """A difference, computed here or by the server: first minus second, its 95 % interval, and p.

    The interval and p are None where there are too few recordings.
    """

    @property
    def difference(self) -> float:
        """First minus second, in the column's unit."""

    @property
    def low(self) -> float | None:
        """Lower end of its interval."""

    @property
    def high(self) -> float | None:
        """Upper end of its interval."""

    @property
    def p(self) -> float | None:
        """Of the two-sided test."""


def is_significant(found: Found) -> bool:
    """Whether p is below 5 %: of this column alone, whatever else was looked at."""
    return found.p is not None and found.p < SIGNIFICANT


def sentence(first: str, second: str, *, name: str, found: Found) -> str:
    """What a difference in one column means, in words.

    >>> from evaluator.uncertainty import Difference
    >>> sentence("A", "B", name="mid_crucial", found=Difference(-4.1, -5.3, -2.9, 0.0003))
    "A's MiD on crucial is 4.1 ± 1.2 lower than B's; p = 0.0003."
    >>> sentence("A", "B", name="rte", found=Difference(0.7, 0.2, 1.2, 0.02))
    "A's RTE is 0.70 ± 0.50 percentage points higher than B's; p = 0.02."
    >>> sentence("Two frames", "B", name="mid", found=Difference(-2.0, -3.1, -0.9, 0.002))
    "Two frames' MiD is 2.0 ± 1.1 lower than B's; p = 0.002."
    """
    metric, _, interval = name.partition("_")
    label, unit = _METRIC_WORDS[metric]
    column = f"{label}{_INTERVAL_WORDS[interval or 'overall']}"
    if found.difference == 0 and not is_significant(found):
        return f"{first} and {second} have the same {column}."
    direction = "lower" if found.difference < 0 else "higher"
    if found.low is None or found.high is None or found.p is None:
        amount = f"{abs(found.difference):.2f}".rstrip("0").rstrip(".")
        return (
            f"{_of(first)} {column} is {amount}{unit} {direction} than {_of(second)}; "
            "there are too few recordings to say whether that means anything."
        )
    half = (found.high - found.low) / 2
    decimals = _decimals(half)
    amount = f"{abs(found.difference):.{decimals}f} ± {half:.{decimals}f}"
    chance = f"p = {found.p:.2g}" + (
        "" if is_significant(found) else ", which chance alone may well have made"
    )
    return f"{_of(first)} {column} is {amount}{unit} {direction} than {_of(second)}; {chance}."


def _of(name: str) -> str:
    return f"{name}'" if name.endswith(("s", "S")) else f"{name}'s"


def _decimals(half: float) -> int:
    """As many as give the half width two digits, and never more than are published."""
    return 0 if half >= 10 else 1 if half >= 0.995 else 2


def others(first: str, second: str, found: Mapping[str, Found]) -> tuple[str, tuple[str, ...]]:
    """Beside overall MiD: how many columns differ significantly, of how many, and a sentence for each.

    Whoever looks through nine columns finds some by chance, so the first text says how many were looked at
    and what that means. It is empty where no column has a p.

    >>> from evaluator.uncertainty import Difference
    >>> alike, far = Difference(0.1, -0.2, 0.4, 0.5), Difference(-4.1, -5.3, -2.9, 0.0003)
    >>> others("A", "B", {"mid": far, "mid_small": alike})
    ('No other column differs significantly.', ())
    >>> others("A", "B", {"mid": alike, "mid_small": far, "rte": alike})[0]
    'Of 2 other columns 1 differs significantly, each by itself (of twenty columns of equals, one does):'
    """
    tested = [name for name in SCORE_NAMES[1:] if name in found and found[name].p is not None]
    told = [name for name in tested if is_significant(found[name])]
    if not told:
        return ("No other column differs significantly." if tested else ""), ()
    columns = "column" if len(tested) == 1 else "columns"
    differ = "differs" if len(told) == 1 else "differ"
    lead = (
        f"Of {len(tested)} other {columns} {len(told)} {differ} significantly, each by itself "
        "(of twenty columns of equals, one does):"
    )
    return lead, tuple(sentence(first, second, name=name, found=found[name]) for name in told)
