"""How often intervals of means and of differences hold the truth, and how often p is small by chance."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evaluator.scoring import differences, uncertainty
from tests.error_models import Drawn, Model
from tests.validity import chunks
from tests.validity.worlds import summed

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]


def as_drawn(drawn: Drawn) -> Drawn:
    """Leave recordings as the units."""
    return drawn


def days_of(per_day: int) -> Callable[[Drawn], Drawn]:
    """Make days the units: `per_day` recordings one after the other."""

    def days(drawn: Drawn) -> Drawn:
        return Drawn(*(summed(part, per_day=per_day) for part in (drawn.counts, drawn.first, drawn.second)))

    return days


@dataclass(frozen=True)
class Shares:
    """Shares of `n` repetitions: intervals that hold the truth, p < 0.05 and p ≤ 0.001 by chance.

    Both methods are equally good. `of_means` are the intervals of the first and of the second method's mean.
    With 1,999 vectors of signs p ≤ 0.001 has a chance of exactly 0.1 %; the board's p < 0.001 has 0.09 %.
    """

    of_means: tuple[float, float]
    of_difference: float
    below_5_percent: float
    up_to_1_permille: float
    n: int


@dataclass(frozen=True)
class Coverage:
    """What holds in all repetitions of one model, and in those whose recordings suffice for the board.

    `n_contradictions` counts differences whose interval excludes 0 while p ≥ 0.05, or holds 0 while p < 0.05.
    """

    all: Shares
    shown: Shares
    n_contradictions: int

    @property
    def share_shown(self) -> float:
        """The share of all repetitions for which the board shows intervals."""
        return self.shown.n / self.all.n


def coverage(
    model: Model,
    *,
    n_recordings: int,
    n: int,
    n_resamples: int,
    n_flips: int,
    rng: np.random.Generator,
    units: Callable[[Drawn], Drawn] = as_drawn,
) -> Coverage:
    """Make the intervals of two means, and of their difference, which is truly 0.

    `units` makes the resampled units of the recordings that were drawn.
    """
    mean = model.mean()
    # One row for each of the `Shares`, one column for each repetition, and which of them are shown.
    holds: list[Booleans] = []
    shown: list[Booleans] = []
    for chunk in chunks(n):
        drawn = units(model.draw(n_recordings, chunk, rng))
        bootstrap = uncertainty.Bootstrap(drawn.counts, rng=rng, n_resamples=n_resamples)
        shown.append(bootstrap.usable)
        # What the intervals would be, also where the board shows none.
        bootstrap.__dict__["usable"] = np.ones(chunk, dtype=np.bool_)
        low, high = bootstrap.intervals(np.stack([drawn.first, drawn.second]))
        flipped = differences.sign_flips(drawn.first - drawn.second, drawn.counts, rng=rng, n_flips=n_flips)
        holds_zero = (flipped.low <= 0) & (flipped.high >= 0)
        of_means = (low <= mean) & (mean <= high)
        holds.append(np.stack([*of_means, holds_zero, flipped.p < 0.05, flipped.p <= 0.001]))
    every, is_shown = np.concatenate(holds, axis=1), np.concatenate(shown)
    return Coverage(_shares(every), _shares(every[:, is_shown]), int((every[2] == every[3]).sum()))


def _shares(holds: Booleans) -> Shares:
    n = holds.shape[1]
    first, second, zero, small, tiny = (holds.sum(axis=1) / max(n, 1)).tolist()
    return Shares((first, second), zero, small, tiny, n)


def by_sequences(model_rho: float, *, n_recordings: int, n: int, rng: np.random.Generator) -> float:
    """How often a z-test of single sequences calls two equally good methods different at 5 %.

    Errors are exponential; the share `model_rho` of their variance belongs to the recording.
    """
    n_called = 0
    for _ in range(n):
        sizes = 1 + rng.poisson(rng.gamma(2.0, 20.0, n_recordings))
        of_recordings = rng.exponential(model_rho**0.5, (2, n_recordings))
        own = rng.exponential((1 - model_rho) ** 0.5, (2, int(sizes.sum())))
        gaps = np.repeat(of_recordings[0] - of_recordings[1], sizes) + own[0] - own[1]
        n_called += bool(abs(gaps.mean()) > 1.959964 * gaps.std(ddof=1) / gaps.size**0.5)
    return n_called / n
