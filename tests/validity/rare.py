"""Errors that are rare, as warning errors of a good method: when there is an interval, and what it holds."""

from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray

from evaluator import Difference
from evaluator.scoring import differences, uncertainty
from tests.validity import CHUNK, chunks
from tests.validity.worlds import LENGTHS

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Rare:
    """Shares of `n` repetitions with a number of errors to be expected of both methods.

    `mean_shown` and `difference_shown` say how often there is an interval, `mean` and `difference` how often
    it then holds the truth, and `power` how often the median detectable difference is found.
    """

    mean_shown: float
    mean: float
    difference_shown: float
    difference: float
    power: float
    n: int


def rare(
    n_expected: float, *, n_recordings: int, n: int, n_flips: int, n_resamples: int, rng: np.random.Generator
) -> Rare:
    """Simulate two methods with the same probability of an error, in % as a board shows it."""
    holds: list[list[NDArray[np.bool_]]] = [[], [], [], []]
    detectable: list[float] = []
    for chunk in chunks(n):
        counts, (first, second) = _drawn((n_expected, n_expected), n_recordings, chunk, rng)
        truth = 100 * n_expected / (n_recordings * LENGTHS.mean())
        bootstrap = uncertainty.Bootstrap(counts, rng=rng, n_resamples=n_resamples)
        low, high = (ends[0] for ends in bootstrap.intervals(first[None]))
        compared = _compared(first, second, counts, n_flips, rng)
        known = np.array([each.p is not None for each in compared])
        detectable += [each.resolution for each in compared if each.resolution is not None]
        parts = (
            np.isfinite(low),
            ((low <= truth) & (truth <= high))[np.isfinite(low)],
            known,
            np.array([each.p >= 0.05 for each in compared if each.p is not None], dtype=np.bool_),
        )
        for kept, part in zip(holds, parts, strict=True):
            kept.append(part)
    shares = [float(np.concatenate(part).mean()) if sum(map(len, part)) else float("nan") for part in holds]
    power = float("nan")
    if detectable:
        further = median(detectable) * n_recordings * LENGTHS.mean() / 100
        n_significant = 0
        for chunk in chunks(n):
            counts, (first, second) = _drawn((n_expected + further, n_expected), n_recordings, chunk, rng)
            compared = _compared(first, second, counts, n_flips, rng)
            n_significant += sum(each.is_significant for each in compared)
        power = n_significant / n
    return Rare(shares[0], shares[1], shares[2], shares[3], power, n)


def _compared(
    first: Floats, second: Floats, counts: Floats, n_flips: int, rng: np.random.Generator
) -> list[Difference]:
    names = [str(i) for i in range(CHUNK)][: counts.shape[1]]
    return list(
        differences.difference(first, second, counts, names=names, signs=rng, n_flips=n_flips).values()
    )


def _drawn(
    n_expected: tuple[float, float], n_recordings: int, n: int, rng: np.random.Generator
) -> tuple[Floats, list[Floats]]:
    counts = LENGTHS[rng.integers(0, len(LENGTHS), size=(n_recordings, n))]
    sums = []
    for each in n_expected:
        # Some recordings are harder than others: the rate varies by a factor of about 3.
        rates = rng.gamma(1.0, 1.0, counts.shape) * each / (n_recordings * LENGTHS.mean())
        sums.append(100.0 * np.minimum(rng.poisson(rates * counts), counts))
    return counts, sums
