"""How sure a mean is, and a difference, and a rank: resampling whole recordings.

Sequences of one recording ("bag") resemble each other, so 28,600 of them know less than 28,600 independent
ones would. What is drawn anew here is therefore the recording, never the sequence. With S_g and n_g the sum
of an error and the number of sequences of recording g, a published mean is θ = ΣS_g / Σn_g, and

    θ⁽ᵇ⁾ = Σ w_bg S_g / Σ w_bg n_g        w_bg ~ Exp(1), b = 1 … B

is what it might have been (a Bayesian bootstrap of recordings). An Exp(1) weight is never 0, so no interval
of the ground truth runs empty. One matrix of weights belongs to a ground truth and is shared by all that is
scored against it: the difference of two entries is then taken resample by resample, and what both find hard
cancels.

Everything is a function of the sums and of the seed: the same numbers give the same answer, in whatever order
they come. Arrays have one row for each recording and one column for each score name.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from statistics import NormalDist
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluator.predictions import Predictions
from evaluator.protocol import DEFAULT_PROTOCOL, SCORE_NAMES, Protocol, get_protocol
from evaluator.report import BagSums
from evaluator.scale import Floats
from evaluator.scoring import Scorer
from evaluator.truth import GroundTruth

MIN_BAGS: Final = 20
"""Below this many recordings nothing is resampled: too few to stand for what could have been recorded."""

CONFIDENCE: Final = 0.95
N_RESAMPLES: Final = 10_000
N_SIGN_FLIPS: Final = 9_999
N_RANK_FLIPS: Final = 2_000
"""Ranks compare all pairs at once, 19,900 of 200 entries; their critical value is read from so many draws."""

_BLOCK: Final = 1_000
# So many float32 are a megabyte.
_CACHED: Final = 1 << 18
# So many entries at once make one product large enough to be fast.
BATCH: Final = 8
# Beside an entry's own sum of squares, what is below this is left of rounding: the pair is alike.
_ALIKE: Final = 1e-12
_NO_SUM: Final = 1e-12

Weights = NDArray[np.float32]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]


def generator_of(digest: str, *, purpose: str) -> np.random.Generator:
    """The random numbers that belong to a ground truth's revision; each purpose has its own."""
    seed = hashlib.sha256(f"{purpose} {digest}".encode()).digest()
    return np.random.default_rng(int.from_bytes(seed))


def usable_columns(counts: Floats) -> Booleans:
    """Which columns of `counts` (G, columns) have sequences in enough recordings."""
    return np.asarray((counts > 0).sum(axis=0) >= MIN_BAGS)


@dataclass(frozen=True, slots=True)
class Difference:
    """First minus second in one column: below 0 the first is better.

    `low` and `high` are its 95 % interval, `p` is the two-sided cluster sign-flip test's; None where fewer
    than 20 of the recordings have sequences of that interval.
    """

    difference: float
    low: float | None
    high: float | None
    p: float | None


@dataclass(frozen=True, slots=True, eq=False)
class RankRanges:
    """Where each of N entries may stand in each of the columns, int64 (N, columns); 0 where there is none.

    `is_with_best` says which are not significantly worse than the best of their column.
    """

    low: Integers
    high: Integers
    is_with_best: Booleans


class Bootstrap:
    """The shared weights of one ground truth, ready for the sums of many entries.

    `counts` is (G, columns), sequences per recording; all entries have the same, since intervals are made by
    the truth. A recording without sequences in an interval says nothing of it.
    """

    def __init__(self, counts: Floats, *, rng: np.random.Generator, n_resamples: int = N_RESAMPLES) -> None:
        self._counts = counts
        self._n = counts.sum(axis=0)
        # Recordings in rows: a product with sums is then contiguous in the resamples.
        self._weights: Weights = np.ascontiguousarray(
            rng.standard_exponential((n_resamples, len(counts)), dtype=np.float32).T
        )

    @cached_property
    def usable(self) -> Booleans:
        """Which columns have sequences in enough recordings."""
        return usable_columns(self._counts)

    @cached_property
    def _tails(self) -> Floats:
        """What lies beyond either end of an interval, of every column: less than 2.5 % for few recordings.

        They count as (Σn)² / Σn² recordings of equal size.
        """
        squares = (self._counts**2).sum(axis=0)
        effective = np.divide(self._n**2, squares, out=np.ones_like(squares), where=squares > 0)
        return np.array([_tail(value) for value in effective.tolist()])

    @cached_property
    def _inverse_counts(self) -> Weights:
        """1 / Σwn in every resample, (columns, B); 0 for a column without sequences."""
        weighted = self._counts.T.astype(np.float32) @ self._weights
        return np.asarray(np.divide(1, weighted, out=np.zeros_like(weighted), where=weighted > 0))

    @cached_property
    def _usable_inverse_counts(self) -> Weights:
        return self._inverse_counts[self.usable]

    def means(self, sums: Floats) -> Floats:
        """θ of every column, for sums (…, G, columns); NaN for a column without sequences."""
        with np.errstate(invalid="ignore"):
            return np.asarray(sums.sum(axis=-2) / self._n)

    def deviations(self, sums: Floats) -> Weights:
        """θ⁽ᵇ⁾ − θ of the usable columns of some entries, float32 (entries, usable, B).

        Σw(S − θn) / Σwn: centred before the product, so that nothing is lost where θ is large.
        """
        centred = (sums - self.means(sums)[:, None, :] * self._counts)[:, :, self.usable]
        rows = np.ascontiguousarray(centred.transpose(0, 2, 1), dtype=np.float32)
        weighted = rows.reshape(-1, rows.shape[2]) @ self._weights
        shaped = weighted.reshape(*rows.shape[:2], -1)
        return np.asarray(np.multiply(shaped, self._usable_inverse_counts, out=shaped))

    def intervals(self, sums: Floats) -> tuple[Floats, Floats]:
        """The 95 % intervals of N entries by their `sums` (N, G, columns): quantiles of θ⁽ᵇ⁾.

        Two (N, columns), NaN where there is none. Each is a function of its own entry alone: it is computed
        in a product of one and the same shape, whoever else is on the board.
        """
        low = np.full((len(sums), sums.shape[2]), np.nan)
        high = low.copy()
        if not self.usable.any():
            return low, high
        for start in range(0, len(sums), BATCH):
            some = sums[start : start + BATCH]
            padded = np.zeros((BATCH, *some.shape[1:]))
            padded[: len(some)] = some
            deviations = self.deviations(padded)[: len(some)]
            means = self.means(some)
            rows = slice(start, start + len(some))
            for i, column in enumerate(np.flatnonzero(self.usable).tolist()):
                ends = _ends(deviations[:, i], tail=float(self._tails[column]))
                low[rows, column], high[rows, column] = means[:, column] + ends
        return low, high


def _tail(n_effective: float) -> float:
    """The share of resamples beyond either end of a 95 % interval of so many recordings of equal size.

    Bare percentiles are those of a normal distribution whose variance is known, and n recordings scatter a
    little less about their own mean than about the true one: Φ(−t_{n−1}(97.5 %) · √(n / (n − 1))), the
    expanded percentiles of Hesterberg (The American Statistician 69, 2015).

    >>> round(_tail(1e9), 4), round(_tail(100.0), 4), round(_tail(20.0), 4)
    (0.025, 0.0231, 0.0159)
    """
    z, degrees = NormalDist().inv_cdf((1 + CONFIDENCE) / 2), max(n_effective, 3.0) - 1
    # Student's quantile from the normal one (Fisher and Cornish 1960); 2.093 at 19 degrees, as it should be.
    t = z + (z**3 + z) / (4 * degrees) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * degrees**2)
    return NormalDist().cdf(-t * ((degrees + 1) / degrees) ** 0.5)


def _ends(deviations: Weights, *, tail: float) -> Floats:
    """The quantiles `tail` and 1 − `tail` of every row, (2, rows), as `numpy.quantile` takes them."""
    last = deviations.shape[1] - 1
    places = [tail * last, (1 - tail) * last]
    indices = sorted({i for place in places for i in (int(place), min(int(place) + 1, last))})
    parted = np.partition(deviations, indices, axis=1)
    found = []
    for place in places:
        i = int(place)
        lower, upper = parted[:, i].astype(np.float64), parted[:, min(i + 1, last)].astype(np.float64)
        found.append(lower + (upper - lower) * (place - i))
    return np.stack(found)


def rank_ranges(
    sums: Floats,
    *,
    published: Floats,
    usable: Booleans,
    rng: np.random.Generator,
    between: Callable[[], None] = lambda: None,
) -> RankRanges:
    """Rank ranges at 95 % of N entries by their `sums` (N, G, columns), of the columns that are `usable`.

    `published` (N, columns) are their values as they are ranked, NaN where an entry has none. In each column
    all pairs are compared at once: step-down max-t over the paired differences, from 1 + (how many are
    significantly better) to N − (how many are significantly worse), after Mogstad, Romano, Shaikh and Wilhelm
    (Review of Economic Studies 91, 2024). With 95 % probability every range of a column holds its entry's
    true rank. A difference is studentised by its own recordings, t = ΣD_g / √ΣD_g², and what chance makes of
    the largest t is read from turning the recordings' signs, as `sign_flip_p` does for one pair.

    Values that are published alike are never told apart, so a range holds the published rank as well.
    `between` is called every fraction of a second.
    """
    low = np.zeros(published.shape, dtype=np.int64)
    high, is_with_best = low.copy(), np.zeros(low.shape, dtype=np.bool_)
    shape = (N_RANK_FLIPS, sums.shape[1])
    signs = rng.integers(0, 2, size=shape, dtype=np.int8).astype(np.float32) * 2 - 1
    for column in np.flatnonzero(usable).tolist():
        present = np.flatnonzero(np.isfinite(published[:, column]))
        if not present.size:
            continue
        rows = present[np.argsort(published[present, column], kind="stable")]
        is_worse = _worse(sums[rows, :, column], published[rows, column], signs, between)
        low[rows, column] = 1 + is_worse.sum(axis=1)
        high[rows, column] = len(rows) - is_worse.sum(axis=0)
        is_with_best[rows, column] = ~is_worse[:, 0]
    return RankRanges(low, high, is_with_best)


def _worse(sums: Floats, values: Floats, signs: Weights, between: Callable[[], None]) -> Booleans:
    """For entries in ascending order, (N, N): whether the row's is significantly worse than the column's.

    The family are the one-sided hypotheses θ_b ≤ θ_a of all ordered pairs. Those with b above a can never be
    rejected and stay in it at every step (`down`); the others leave it as they are rejected (`up`).
    """
    # What all have in common is in no difference, and would cost the products their digits.
    own = sums - sums.mean(axis=0)
    inverse = _inverse_error(own)
    totals = own.sum(axis=1)
    t = np.where(values[:, None] > values[None, :], (totals[:, None] - totals[None, :]) * inverse, 0.0)
    turned = own.astype(np.float32) @ signs.T
    rejected = np.zeros(t.shape, dtype=np.bool_)
    single = inverse.astype(np.float32)
    up, down = _extremes(turned, single, rejected, between)
    while True:
        critical = float(np.quantile(np.maximum(up, down), CONFIDENCE, method="higher"))
        found = t > critical
        if not (found & ~rejected).any():
            return rejected
        rejected |= found
        up, _ = _extremes(turned, single, rejected, between)


def _inverse_error(sums: Floats) -> Floats:
    """1 / √ΣD² of every pair, (N, N), with ΣD² = Q_aa + Q_bb − 2 Q_ab; 0 for pairs that are alike."""
    products = sums @ sums.T
    own = np.diag(products)
    squares = own[:, None] + own[None, :] - 2 * products
    is_alike = squares <= _ALIKE * np.maximum(own[:, None], own[None, :])
    return np.where(is_alike, 0.0, 1 / np.sqrt(np.where(is_alike, 1.0, squares)))


def _extremes(
    turned: Weights, inverse: Weights, left_out: Booleans, between: Callable[[], None]
) -> tuple[Weights, Weights]:
    """In every draw the largest studentised rise and fall over pairs a < b, without pairs left out.

    One a and a block of draws at a time, which stay in the processor's cache: all pairs at once, 19,900 ×
    2,000, would be 160 MB.
    """
    n_entries, n_draws = turned.shape
    up, down = np.zeros((2, n_draws), dtype=np.float32)
    partners = [a + 1 + np.flatnonzero(~left_out[a + 1 :, a]) for a in range(n_entries - 1)]
    size = max(_CACHED // n_entries, 1)
    buffer = np.empty((n_entries, size), dtype=np.float32)
    for start in range(0, n_draws, size):
        between()
        block = slice(start, min(start + size, n_draws))
        part = np.ascontiguousarray(turned[:, block])
        for a, rows in enumerate(partners):
            if rows.size:
                is_run = rows[-1] - rows[0] + 1 == rows.size
                chosen = part[rows[0] : rows[-1] + 1] if is_run else part[rows]
                rises = buffer[: rows.size, : part.shape[1]]
                np.subtract(chosen, part[a], out=rises)
                np.multiply(rises, inverse[a, rows, None], out=rises)
                np.maximum(up[block], rises.max(axis=0), out=up[block])
                np.maximum(down[block], -rises.min(axis=0), out=down[block])
    return up, down


def sign_flip_p(differences: Floats, *, rng: np.random.Generator, n_flips: int = N_SIGN_FLIPS) -> Floats:
    """Two-sided p of every column of `differences` (G, columns) by the cluster sign-flip test.

        p = (1 + #{|Σ ±D_g| ≥ |Σ D_g|}) / (R + 1)

    D_g = S_g of the first − S_g of the second entry: since both have the same sequences, ΣD_g / n is the
    difference of their means, and no ratio has to be linearised. If neither is better, D_g is as likely to be
    −D_g; a recording is turned as a whole, since its sequences are not independent. Recordings without
    sequences in an interval have D_g = 0 and change nothing. Without any difference p is 1.
    """
    observed = np.abs(differences.sum(axis=0))
    # Sums of the same numbers in another order differ by rounding, and are still as large.
    at_least = observed - _NO_SUM * np.abs(differences).sum(axis=0)
    n_as_large = np.zeros(differences.shape[1], dtype=np.int64)
    for start in range(0, n_flips, _BLOCK):
        n = min(_BLOCK, n_flips - start)
        signs = rng.integers(0, 2, size=(n, len(differences)), dtype=np.int8) * 2.0 - 1.0
        n_as_large += (np.abs(signs @ differences) >= at_least).sum(axis=0)
    return np.asarray((1 + n_as_large) / (n_flips + 1))


def difference(
    first: Floats,
    second: Floats,
    *,
    bootstrap: Bootstrap,
    signs: np.random.Generator,
    n_flips: int = N_SIGN_FLIPS,
) -> dict[str, Difference]:
    """Compare the sums of two entries, (G, 10) each; a column without sequences is absent."""
    gaps = first - second
    means = bootstrap.means(gaps)
    low, high = (ends[0] for ends in bootstrap.intervals(gaps[None]))
    p = sign_flip_p(gaps, rng=signs, n_flips=n_flips)
    return {
        name: Difference(float(means[i]), float(low[i]), float(high[i]), float(p[i]))
        if bootstrap.usable[i]
        else Difference(float(means[i]), None, None, None)
        for i, name in enumerate(SCORE_NAMES)
        if np.isfinite(means[i])
    }


def bootstrap_of(truth_digest: str, counts: Floats) -> Bootstrap:
    """The weights that belong to a ground truth's revision."""
    return Bootstrap(counts, rng=generator_of(truth_digest, purpose="weights"))


def bag_sums(
    predictions: Predictions, truth: GroundTruth, *, protocol: str | Protocol = DEFAULT_PROTOCOL
) -> BagSums:
    """Sums per recording of one set of predictions; raises as `evaluator.evaluate` does."""
    rules = get_protocol(protocol) if isinstance(protocol, str) else protocol
    bags = Scorer(truth, rules).report(predictions, keep_bags=True).bags
    assert bags is not None  # noqa: S101 - they were asked for
    return bags


def confidence_intervals(
    predictions: Predictions, truth: GroundTruth, *, protocol: str | Protocol = DEFAULT_PROTOCOL
) -> dict[str, tuple[float, float] | None]:
    """The 95 % interval of each of the ten numbers, as the board shows it; None where there is none."""
    bags = bag_sums(predictions, truth, protocol=protocol)
    low, high = (ends[0] for ends in bootstrap_of(truth.digest, bags.counts).intervals(bags.sums[None]))
    return {
        name: (float(low[i]), float(high[i])) if np.isfinite(low[i]) else None
        for i, name in enumerate(SCORE_NAMES)
    }


def compare_predictions(
    first: Predictions,
    second: Predictions,
    truth: GroundTruth,
    *,
    protocol: str | Protocol = DEFAULT_PROTOCOL,
    n_flips: int = N_SIGN_FLIPS,
) -> dict[str, Difference]:
    """Compare two sets of predictions of the same sequences: first minus second under each score name.

    The random numbers belong to the ground truth's revision, so these are the numbers of the board's own
    comparison. A column without sequences is absent. Raises as `evaluator.evaluate` does.
    """
    one, other = (bag_sums(each, truth, protocol=protocol) for each in (first, second))
    return difference(
        one.sums,
        other.sums,
        bootstrap=bootstrap_of(truth.digest, one.counts),
        signs=generator_of(truth.digest, purpose="signs"),
        n_flips=n_flips,
    )
