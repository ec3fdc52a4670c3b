"""Simulate whether intervals and ranges hold where recordings of a day are alike: `python -m tests.days`.

Methods with equal true means. The error of a method in a recording is its mean times a log-normal effect of
its own, which recordings of one day have in common in part, and the noise of its sequences. The same numbers
are inferred from twice: with recordings as units, and with days.
"""

import sys
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evaluator.scoring import differences, ranges, uncertainty
from evaluator.units import Units, units_of

Floats = NDArray[np.float64]
N_METHODS = 8
SIGMA_OF_LENGTH, MEDIAN_LENGTH = 0.4, 40.0
SIGMA_OF_EFFECT = 0.6
# Repetitions stand in columns, as score names do elsewhere.
CHUNK = 50
N_RESAMPLES, N_SIGN_FLIPS = 2_000, 1_999
WORLDS = [(n, per_day, rho) for n, per_day in ((150, 5), (700, 35)) for rho in (0.0, 0.05, 0.1, 0.2)]


@dataclass(frozen=True)
class World:
    """Recordings, as many each day; `rho` is the correlation of the logarithms of two effects of one day."""

    n_recordings: int
    per_day: int
    rho: float

    @property
    def days(self) -> Units:
        """The days of its recordings, as the column `unit` would give them, however few they are."""
        names = [f"{i:04d}" for i in range(self.n_recordings)]
        given = {name: f"{i // self.per_day:04d}" for i, name in enumerate(names)}
        return units_of(names, given=given)

    def draw(self, n: int, rng: np.random.Generator, *, n_methods: int = N_METHODS) -> tuple[Floats, Floats]:
        """Sums of the methods (methods, G, n), whose true means are 1, and counts (G, n)."""
        shape = self.n_recordings, n
        counts = np.ceil(MEDIAN_LENGTH * np.exp(SIGMA_OF_LENGTH * rng.standard_normal(shape)))
        of_days = np.repeat(
            rng.standard_normal((n_methods, self.n_recordings // self.per_day, n)), self.per_day, axis=1
        )
        own = rng.standard_normal((n_methods, *shape))
        effect = self.rho**0.5 * of_days + (1 - self.rho) ** 0.5 * own
        level = np.exp(SIGMA_OF_EFFECT * effect - SIGMA_OF_EFFECT**2 / 2)
        # The sum of so many exponential errors.
        return level * rng.gamma(np.broadcast_to(counts, level.shape)), counts


@dataclass(frozen=True)
class Coverage:
    """In how many of `n` repetitions 95 % intervals and all rank ranges of a column hold the truth."""

    of_mean: float
    of_difference: float
    of_all_ranges: float
    n: int


def coverage(world: World, *, n: int, rng: np.random.Generator) -> dict[str, Coverage]:
    """With recordings as units, and with days."""
    held = {"recordings": np.zeros(3), "days": np.zeros(3)}
    for start in range(0, n, CHUNK):
        sums, counts = world.draw(min(CHUNK, n - start), rng)
        for units in held:
            if units == "days":
                sums, counts = (uncertainty.by_units(each, world.days) for each in (sums, counts))
            held[units] += _held(sums, counts, rng=rng)
    shares = {units: (found / n).tolist() for units, found in held.items()}
    return {units: Coverage(mean, gap, ranks, n) for units, (mean, gap, ranks) in shares.items()}


def _held(sums: Floats, counts: Floats, *, rng: np.random.Generator) -> Floats:
    n = counts.shape[1]
    low, high = uncertainty.Bootstrap(counts, rng=rng, n_resamples=N_RESAMPLES).intervals(sums[:1])
    flips = differences.sign_flips(sums[0] - sums[1], counts, rng=rng, n_flips=N_SIGN_FLIPS)
    found = ranges.rank_ranges(
        sums, published=sums.sum(axis=1) / counts.sum(axis=0), usable=np.ones(n, dtype=np.bool_), rng=rng
    )
    # Equal methods may stand anywhere: each range must leave room for all of it.
    all_hold = (found.low == 1).all(axis=0) & (found.high == len(sums)).all(axis=0)
    of_mean = (low[0] <= 1) & (high[0] >= 1)
    of_difference = (flips.low <= 0) & (flips.high >= 0)
    return np.array([of_mean.sum(), of_difference.sum(), all_hold.sum()], dtype=np.float64)


def main(n: int = 2_000) -> None:
    """Print a row for each world: `n` repetitions, margins at 95 %."""
    for n_recordings, per_day, rho in WORLDS:
        rng = np.random.default_rng([n_recordings, per_day, int(1000 * rho)])
        found = coverage(World(n_recordings, per_day, rho), n=n, rng=rng)
        cells = [
            f"{100 * share:.1f} ± {196 * (max(share * (1 - share), 1e-9) / n) ** 0.5:.1f}"
            for each in found.values()
            for share in (each.of_mean, each.of_difference, each.of_all_ranges)
        ]
        sys.stdout.write(f"| {n_recordings}, {per_day} | {rho} | {' | '.join(cells)} |\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
