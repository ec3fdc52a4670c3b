"""Whether intervals, tests and rank ranges keep their promises, by simulation: `python -m tests.validity`.

Errors of made-up methods on made-up recordings, where the truth is known. Everything is drawn anew in each
repetition: recordings, their sizes (41 sequences on average, from one to a few hundred) and the errors, which
are exponential, as skewed as real ones. A share ρ of an error's variance belongs to its recording: that is
the correlation of two sequences of the same recording. The suite runs few repetitions; the command many, and
prints the table of `docs/uncertainty.md`.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evaluator import differences, ranges, uncertainty

Floats = NDArray[np.float64]
N_BAGS = (100, 300, 700)
CORRELATIONS = (0.05, 0.2)
SIGMA = 20.0
# Repetitions stand in columns, as score names do elsewhere; so many at a time fit into memory.
CHUNK = 50


@dataclass(frozen=True)
class World:
    """How many recordings there are, and how much their sequences resemble each other."""

    n_bags: int
    correlation: float

    def sizes(self, n: int, rng: np.random.Generator) -> Floats:
        """Sequences per recording, (recordings, n)."""
        return 1 + np.asarray(rng.poisson(rng.gamma(2.0, 20.0, (self.n_bags, n))), dtype=np.float64)

    @property
    def mean(self) -> float:
        """The true mean error of every method before its own level is added."""
        return SIGMA * (self.correlation**0.5 + (1 - self.correlation) ** 0.5)

    def sums(self, sizes: Floats, rng: np.random.Generator, *, n_methods: int = 1) -> Floats:
        """Sums of errors per recording, (methods, recordings, n)."""
        shape = (n_methods, *sizes.shape)
        of_recordings = rng.exponential(SIGMA * self.correlation**0.5, shape)
        # The sum of n independent exponential errors is one gamma variable of shape n.
        own = rng.gamma(np.broadcast_to(sizes, shape), SIGMA * (1 - self.correlation) ** 0.5)
        return sizes * of_recordings + own


def worlds() -> list[World]:
    """All that is looked at."""
    return [World(n_bags, correlation) for n_bags in N_BAGS for correlation in CORRELATIONS]


def _chunks(n: int) -> Iterator[int]:
    for start in range(0, n, CHUNK):
        yield min(CHUNK, n - start)


@dataclass(frozen=True)
class Errors:
    """How often two equally good methods are called different, at a nominal 5 %."""

    by_recording: float
    by_sequence: float


def errors_of_the_tests(world: World, *, n: int, n_flips: int, rng: np.random.Generator) -> Errors:
    """Test the difference of two methods that are equally good, by recordings and, wrongly, by sequences."""
    n_by_recording = n_by_sequence = 0
    for chunk in _chunks(n):
        sizes = world.sizes(chunk, rng)
        gaps = np.zeros_like(sizes)
        for column in range(chunk):
            difference, is_called = _two_methods(world, sizes[:, column].astype(int), rng)
            gaps[:, column] = difference
            n_by_sequence += is_called
        p = differences.sign_flip_p(gaps, rng=rng, n_flips=n_flips)
        n_by_recording += int((p < 0.05).sum())
    return Errors(n_by_recording / n, n_by_sequence / n)


def _two_methods(world: World, sizes: NDArray[np.int_], rng: np.random.Generator) -> tuple[Floats, bool]:
    """Differences per recording, and what a paired z-test of the sequences says of them."""
    n, rho = int(sizes.sum()), world.correlation
    of_recordings = rng.exponential(SIGMA * rho**0.5, (2, len(sizes)))
    own = rng.exponential(SIGMA * (1 - rho) ** 0.5, (2, n))
    gaps = np.repeat(of_recordings[0] - of_recordings[1], sizes) + own[0] - own[1]
    z = abs(gaps.mean()) / (gaps.std(ddof=1) / n**0.5)
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    return np.add.reduceat(gaps, starts), bool(z > 1.959964)


@dataclass(frozen=True)
class Coverage:
    """How often a 95 % interval holds the true value: of a mean, and of the difference of two."""

    of_mean: float
    of_difference: float


def coverage_of_intervals(world: World, *, n: int, n_resamples: int, rng: np.random.Generator) -> Coverage:
    """Make intervals of a mean and of a difference that is truly 0."""
    held = np.zeros(2)
    for chunk in _chunks(n):
        sizes = world.sizes(chunk, rng)
        first, second = world.sums(sizes, rng, n_methods=2)
        bootstrap = uncertainty.Bootstrap(sizes, rng=rng, n_resamples=n_resamples)
        low, high = (ends[0] for ends in bootstrap.intervals(first[None]))
        held[0] += ((low <= world.mean) & (world.mean <= high)).sum()
        found = differences.sign_flips(first - second, sizes, rng=rng, n_flips=n_resamples - 1)
        held[1] += ((found.low <= 0) & (found.high >= 0)).sum()
    return Coverage(*(held / n).tolist())


@dataclass(frozen=True)
class Ranks:
    """How often the ranges of a column hold all true ranks at once, how often each, and their width."""

    all_at_once: float
    each: float
    mean_width: float


# In standard errors of a difference: everybody alike, and a field with ties, near ones and far ones.
LEVELS = {"alike": (0.0,) * 10, "spread": (0, 0, 1, 2, 2, 3, 5, 8, 8, 12)}


def coverage_of_ranks(world: World, levels: tuple[float, ...], *, n: int, rng: np.random.Generator) -> Ranks:
    """Make the rank ranges of ten methods whose true means, and so whose true ranks, are known."""
    spread = SIGMA * (2 * (world.correlation * 1.5 + (1 - world.correlation) / 41) / world.n_bags) ** 0.5
    means = np.array(levels) * spread
    lowest = 1 + (means[None, :] < means[:, None]).sum(axis=1)[:, None]
    highest = len(means) - (means[None, :] > means[:, None]).sum(axis=1)[:, None]
    n_all = n_each = width = 0.0
    for chunk in _chunks(n):
        sizes = world.sizes(chunk, rng)
        sums = world.sums(sizes, rng, n_methods=len(means)) + means[:, None, None] * sizes
        published = sums.sum(axis=1) / sizes.sum(axis=0)
        usable = np.ones(chunk, dtype=bool)
        found = ranges.rank_ranges(sums, published=published, usable=usable, rng=rng)
        # Who is truly tied may stand anywhere among their equals; the range must leave room for all of it.
        held = (found.low <= lowest) & (found.high >= highest)
        n_all += held.all(axis=0).sum()
        n_each += held.mean(axis=0).sum()
        width += (found.high - found.low + 1).mean(axis=0).sum()
    return Ranks(n_all / n, n_each / n, width / n)


def main(n: int = 2_000) -> None:
    """Print the tables of the documentation."""
    say = sys.stdout.write
    say(f"{n:,} repetitions of each row\n\n")
    say("| recordings | ρ | sign-flip test by recordings | z-test by sequences | interval of a mean ")
    say("| of a difference |\n|---|---|---|---|---|---|\n")
    for world in worlds():
        rng = np.random.default_rng([world.n_bags, int(100 * world.correlation)])
        errors = errors_of_the_tests(world, n=n, n_flips=differences.N_SIGN_FLIPS, rng=rng)
        coverage = coverage_of_intervals(world, n=n, n_resamples=uncertainty.N_RESAMPLES, rng=rng)
        say(f"| {world.n_bags} | {world.correlation} | {errors.by_recording:.1%} | {errors.by_sequence:.1%} ")
        say(f"| {coverage.of_mean:.1%} | {coverage.of_difference:.1%} |\n")
        sys.stdout.flush()
    say("\n| recordings | ρ | field | all ten ranges hold | one range holds | mean width |\n")
    say("|---|---|---|---|---|---|\n")
    for world in worlds():
        for name, levels in LEVELS.items():
            rng = np.random.default_rng([world.n_bags, int(100 * world.correlation), 1])
            ranks = coverage_of_ranks(world, levels, n=n, rng=rng)
            say(f"| {world.n_bags} | {world.correlation} | {name} | {ranks.all_at_once:.1%} ")
            say(f"| {ranks.each:.1%} | {ranks.mean_width:.1f} |\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
