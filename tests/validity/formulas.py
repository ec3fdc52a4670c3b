"""Figures of docs/uncertainty.md that follow from formulas, without a simulation."""

from collections.abc import Iterator
from statistics import NormalDist

import numpy as np

from evaluator import Difference
from evaluator.scoring.significance import MIN_DEGREES, best_of
from evaluator.scoring.uncertainty import _tail, degrees_of

_NORMAL = NormalDist()


def formulas() -> Iterator[tuple[str, str]]:
    """What is computed, and its value."""
    for p in (0.003, 0.04):
        yield (
            f"an equal study finds a true difference with p = {p}",
            f"{100 * power_of_a_repetition(p):.0f} %",
        )
    for n in (3, 10, 30, 100):
        yield f"the best of {n} independent variants, in standard errors", f"{best_of(n):.2f}"
    yield "the same of 3 variants whose errors correlate by 0.8", f"{best_of(3) * 0.2**0.5:.2f}"
    yield "q of 100 equal units", f"{100 * _tail(100.0, degrees=100.0):.1f} %"
    one = Difference(0.0, -1.0, 1.0, 1.0, n_different=100, n_units=100)
    yield "the detectable difference, in half widths", f"{one.resolution:.2f}"
    for n in (12, 40, 100, 150, 700):
        yield f"the largest share of one of {n} units with an interval", f"{100 * largest_share(n):.1f} %"


def power_of_a_repetition(p: float) -> float:
    """How often an equal study has p < 0.05, if the difference that gave this p is the true one."""
    return _NORMAL.cdf(_NORMAL.inv_cdf(1 - p / 2) - _NORMAL.inv_cdf(0.975))


def largest_share(n_units: int) -> float:
    """The largest share of the sequences that one unit may have, if all others are equal, for an interval."""
    shares = np.linspace(1 / n_units, 0.5, 5_001)
    others = np.repeat((1 - shares)[None] / (n_units - 1), n_units - 1, axis=0)
    degrees = degrees_of(np.concatenate([shares[None], others]))
    return float(shares[degrees >= MIN_DEGREES].max())
