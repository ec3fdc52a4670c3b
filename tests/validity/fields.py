"""How often rank ranges hold the true ranks, and how often a verdict names a winner among equal methods."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evaluator.scoring import ranges
from tests import error_models
from tests.error_models import Model
from tests.validity import chunks

Floats = NDArray[np.float64]
# Draws the sums of some methods, (methods, recordings, n), and the counts, (recordings, n).
Draw = Callable[[int, int, np.random.Generator], tuple[Floats, Floats]]


@dataclass(frozen=True)
class Ranks:
    """How often the ranges of a column hold all true ranks at once, how often each does, and their width.

    `last_marked` is how often the last method is marked as possibly the best.
    """

    all_at_once: float
    each: float
    mean_width: float
    last_marked: float
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

    def draw(n_recordings: int, n: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        sums, counts = _field(model, len(means), n_recordings, n, shared, rng)
        return sums + (means - model.mean())[:, None, None] * counts, counts

    quoted = means[0] if with_quoted_row else None
    return ranks_of(draw, means=means, n_recordings=n_recordings, n=n, rng=rng, quoted=quoted)


def ranks_of(
    draw: Draw,
    *,
    means: Floats,
    n_recordings: int,
    n: int,
    rng: np.random.Generator,
    quoted: float | None = None,
) -> Ranks:
    """Make the rank ranges of methods with these true `means`, and a row quoted with the value `quoted`."""
    everybody = means if quoted is None else np.append(means, quoted)
    lowest = 1 + (everybody[None, :] < means[:, None]).sum(axis=1)[:, None]
    highest = len(everybody) - (everybody[None, :] > means[:, None]).sum(axis=1)[:, None]
    n_all = n_each = width = n_marked = 0.0
    for chunk in chunks(n):
        sums, counts = draw(n_recordings, chunk, rng)
        computed = ranges.rank_ranges(
            sums,
            published=sums.sum(axis=1) / counts.sum(axis=0),
            usable=np.ones(chunk, dtype=np.bool_),
            rng=rng,
            quoted=None if quoted is None else _quoted(quoted, counts),
        )
        # A tied method may stand anywhere among its equals; the range must leave room for all of it.
        is_inside = (computed.low <= lowest) & (computed.high >= highest)
        n_all += is_inside.all(axis=0).sum()
        n_each += is_inside.mean(axis=0).sum()
        width += (computed.high - computed.low + 1).mean(axis=0).sum()
        n_marked += np.count_nonzero(computed.is_with_best[-1])
    return Ranks(n_all / n, n_each / n, width / n, n_marked / n, n)


def all_hold_beside_sampled_papers(
    *, n_methods: int, n_papers: int, n_recordings: int, correlation: float, n: int, rng: np.random.Generator
) -> float:
    """How often all ranges hold next to papers whose values are means over the same recordings."""
    model, shared = error_models.MODELS[0], SHARED[correlation]
    n_all = 0
    for chunk in chunks(n):
        sums, counts = _field(model, n_methods + n_papers, n_recordings, chunk, shared, rng)
        means = sums.sum(axis=1) / counts.sum(axis=0)
        computed = ranges.rank_ranges(
            sums[:n_methods],
            published=means[:n_methods],
            usable=np.ones(chunk, dtype=np.bool_),
            rng=rng,
            quoted=ranges.Quoted(means[n_methods:], np.zeros((n_papers, chunk)), counts),
        )
        is_all = (computed.low == 1) & (computed.high == n_methods + n_papers)
        n_all += int(is_all.all(axis=0).sum())
    return n_all / n


def _quoted(value: float, counts: Floats) -> ranges.Quoted:
    """A quoted row of this value, exactly known, in every column."""
    shape = (1, counts.shape[1])
    return ranges.Quoted(values=np.full(shape, value), half_widths=np.zeros(shape), counts=counts)


def _field(
    model: Model, n_methods: int, n_recordings: int, n: int, shared: float, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Sums of equally good methods, (methods, recordings, n), and the counts, (recordings, n)."""
    drawn = model.draw(n_recordings, n, rng)
    counts, own = drawn.counts, np.empty((n_methods, n_recordings, n))
    for i in range(n_methods):
        own[i] = error_models.exponential_sums(counts, rng)
    return shared * drawn.first + (1 - shared) * own, counts
