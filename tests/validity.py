"""Simulate whether confidence intervals, tests and rank ranges hold: `python -m tests.validity`.

Errors of made-up methods on made-up recordings, where the truth is known: the models of `tests.error_models`.
Everything is drawn anew in each repetition. The suite runs few repetitions; the command many, and prints the
tables of `docs/uncertainty.md`.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evaluator.scoring import differences, ranges, uncertainty
from tests import error_models
from tests.error_models import Model

Floats = NDArray[np.float64]
N_RECORDINGS = (20, 30, 50, 100, 700)
# Repetitions stand in columns, as score names do elsewhere; so many at a time fit into memory.
CHUNK = 100
# Fewer than the board takes, 10,000 and 9,999, and many more repetitions.
N_RESAMPLES = 2_000
N_SIGN_FLIPS = 1_999


def _chunks(n: int) -> Iterator[int]:
    for start in range(0, n, CHUNK):
        yield min(CHUNK, n - start)


def margin(share: float, n: int) -> float:
    """The half width of a 95 % confidence interval of a simulated share."""
    return 1.96 * float(np.sqrt(max(share * (1 - share), 1e-9) / n))


# --- intervals and the test of a difference


@dataclass(frozen=True)
class Coverage:
    """How often 95 % confidence intervals hold the true value, in `n` repetitions of one model.

    `shown` is the share of repetitions whose recordings suffice for the board to show an interval; coverage
    is counted in all. `false_positives` is how often the sign-flip test calls the two equally good methods
    different at 5 %. `n_contradictions` counts differences whose interval excludes 0 while p ≥ 0.05, or holds
    0 while p < 0.05.
    """

    of_mean: float
    of_difference: float
    shown: float
    false_positives: float
    n_contradictions: int
    n: int


def coverage(
    model: Model, *, n_recordings: int, n: int, n_resamples: int, n_flips: int, rng: np.random.Generator
) -> Coverage:
    """Make the intervals of a mean, and of a difference that is truly 0."""
    mean, held_mean, held_zero, shown, called, contradictions = model.mean(), 0, 0, 0, 0, 0
    for chunk in _chunks(n):
        drawn = model.draw(n_recordings, chunk, rng)
        bootstrap = uncertainty.Bootstrap(drawn.counts, rng=rng, n_resamples=n_resamples)
        shown += int(bootstrap.usable.sum())
        # What the intervals would be, also where the board shows none.
        bootstrap.__dict__["usable"] = np.ones(chunk, dtype=np.bool_)
        low, high = (ends[0] for ends in bootstrap.intervals(drawn.first[None]))
        held_mean += int(((low <= mean) & (mean <= high)).sum())
        gaps = drawn.first - drawn.second
        found = differences.sign_flips(gaps, drawn.counts, rng=rng, n_flips=n_flips)
        holds = (found.low <= 0) & (found.high >= 0)
        held_zero += int(holds.sum())
        called += int((found.p < 0.05).sum())
        contradictions += int((holds == (found.p < 0.05)).sum())
    return Coverage(held_mean / n, held_zero / n, shown / n, called / n, contradictions, n)


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


# --- rank ranges


@dataclass(frozen=True)
class Ranks:
    """How often the ranges of a column hold all true ranks at once, how often each does, and their width."""

    all_at_once: float
    each: float
    mean_width: float
    n: int


# In standard errors of a difference: all alike, and a field with ties, near ones and far ones.
LEVELS = {"alike": (0.0,) * 10, "spread": (0, 0, 1, 2, 2, 3, 5, 8, 8, 12)}
# How much of each method's errors all methods share, for a correlation between methods of 0, 0.5 and 0.9.
SHARED = {0.0: 0.0, 0.5: 0.5, 0.9: 0.75}
SIGMA_OF_LEVEL = 0.35


def ranks(
    levels: tuple[float, ...],
    *,
    n_recordings: int,
    correlation: float,
    with_quoted_row: bool,
    n: int,
    rng: np.random.Generator,
) -> Ranks:
    """Make the rank ranges of methods whose true means, and so whose true ranks, are known.

    The quoted row, where there is one, is the true mean of the first method.
    """
    model, shared = error_models.MODELS[0], SHARED[correlation]
    spread = (2 * SIGMA_OF_LEVEL * (1 - shared) ** 2 / n_recordings) ** 0.5
    means = model.mean() + np.array(levels) * spread
    everybody = np.append(means, means[0]) if with_quoted_row else means
    lowest = 1 + (everybody[None, :] < means[:, None]).sum(axis=1)[:, None]
    highest = len(everybody) - (everybody[None, :] > means[:, None]).sum(axis=1)[:, None]
    n_all = n_each = width = 0.0
    for chunk in _chunks(n):
        sums, counts = _field(model, len(means), n_recordings, chunk, shared, rng)
        sums += (means - model.mean())[:, None, None] * counts
        found = ranges.rank_ranges(
            sums,
            published=sums.sum(axis=1) / counts.sum(axis=0),
            usable=np.ones(chunk, dtype=np.bool_),
            rng=rng,
            quoted=_quoted(means[0], counts) if with_quoted_row else None,
        )
        # A tied method may stand anywhere among its equals; the range must leave room for all of it.
        held = (found.low <= lowest) & (found.high >= highest)
        n_all += held.all(axis=0).sum()
        n_each += held.mean(axis=0).sum()
        width += (found.high - found.low + 1).mean(axis=0).sum()
    return Ranks(n_all / n, n_each / n, width / n, n)


def _quoted(value: float, counts: Floats) -> ranges.Quoted:
    """A quoted row of this value, exactly known, in every column."""
    shape = (1, counts.shape[1])
    return ranges.Quoted(values=np.full(shape, value), half_widths=np.zeros(shape), counts=counts)


def _field(
    model: Model, n_methods: int, n_recordings: int, n: int, shared: float, rng: np.random.Generator
) -> tuple[NDArray[np.float64], Floats]:
    """Sums of equally good methods, (methods, recordings, n), and the counts, (recordings, n)."""
    drawn = model.draw(n_recordings, n, rng)
    counts, own = drawn.counts, np.empty((n_methods, n_recordings, n))
    for i in range(n_methods):
        own[i] = error_models.exponential_sums(counts, rng)
    return shared * drawn.first + (1 - shared) * own, counts


# --- the tables of the documentation


def _percent(share: float, n: int) -> str:
    return f"{100 * share:.1f} ± {100 * margin(share, n):.1f}"


def _say(*cells: object) -> None:
    sys.stdout.write(f"| {' | '.join(map(str, cells))} |\n")
    sys.stdout.flush()


def _coverage_table(n: int) -> None:
    _say("errors", "recordings", "CI of a mean", "CI of a difference", "shown", "p < 0.05", "contradictions")
    _say(*["---"] * 7)
    for model in (*error_models.available(), error_models.ONE_FAILS):
        for n_recordings in N_RECORDINGS:
            rng = np.random.default_rng([n_recordings, *model.name.encode()])
            found = coverage(
                model,
                n_recordings=n_recordings,
                n=n,
                n_resamples=N_RESAMPLES,
                n_flips=N_SIGN_FLIPS,
                rng=rng,
            )
            shares = (found.of_mean, found.of_difference, found.shown, found.false_positives)
            mean, difference, shown, called = (_percent(share, n) for share in shares)
            _say(model, n_recordings, mean, difference, shown.split()[0], called, found.n_contradictions)


def _sequences_table(n: int) -> None:
    _say("recordings", "ρ", "z-test by sequences")
    _say(*["---"] * 3)
    for n_recordings in (100, 300, 700):
        for rho in (0.05, 0.2):
            rng = np.random.default_rng([n_recordings, int(100 * rho)])
            _say(n_recordings, rho, _percent(by_sequences(rho, n_recordings=n_recordings, n=n, rng=rng), n))


def _ranks_table(n: int) -> None:
    _say(
        "methods",
        "quoted row",
        "recordings",
        "correlation",
        "all ranges hold",
        "one range holds",
        "mean width",
    )
    _say(*["---"] * 7)
    rows: list[tuple[tuple[float, ...], float, bool, int]] = [
        (levels, 0.0, False, g) for levels in LEVELS.values() for g in (100, 300, 700)
    ]
    rows += [((0.0,) * n_methods, rho, True, 100) for n_methods in (5, 10, 50) for rho in SHARED]
    for levels, rho, with_quoted_row, n_recordings in rows:
        rng = np.random.default_rng([n_recordings, len(levels), int(10 * rho), with_quoted_row])
        found = ranks(
            levels,
            n_recordings=n_recordings,
            correlation=rho,
            with_quoted_row=with_quoted_row,
            n=n,
            rng=rng,
        )
        name = f"{len(levels)}, {'alike' if not any(levels) else 'spread'}"
        holds = _percent(found.all_at_once, n), _percent(found.each, n)
        _say(name, "yes" if with_quoted_row else "no", n_recordings, rho, *holds, f"{found.mean_width:.1f}")


def main(n: int = 20_000, n_of_ranks: int = 3_000) -> None:
    """Print the tables of the documentation: `n` repetitions of each row, `n_of_ranks` of those of ranks."""
    sys.stdout.write(f"{n:,} repetitions of each row\n\n")
    _coverage_table(n)
    sys.stdout.write("\n")
    _sequences_table(n // 10)
    sys.stdout.write(f"\n{n_of_ranks:,} repetitions of each row\n\n")
    _ranks_table(n_of_ranks)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
