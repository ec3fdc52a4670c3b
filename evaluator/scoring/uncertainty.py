"""Confidence intervals of means: a Bayesian bootstrap over units (days or recordings).

With S_g and n_g the sum of errors and the number of sequences of unit g, a published mean is θ = ΣS_g / Σn_g,
and its resamples are

    θ⁽ᵇ⁾ = Σ w_bg S_g / Σ w_bg n_g        w_bg ~ Exp(1), b = 1 … B

Arrays have one row per unit and one column per score name.
"""

# Sequences of one recording, and recordings of one day, are alike: units are resampled. An Exp(1) weight is
# never 0, so no column is ever empty. All entries of a ground truth share one matrix of weights.

from __future__ import annotations

import hashlib
from functools import cached_property
from statistics import NormalDist
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluator.metrics.scale import Floats
from evaluator.scoring.significance import MIN_DEGREES, MIN_DIFFERENT
from evaluator.units import RECORDING, Units

CONFIDENCE: Final = 0.95
N_RESAMPLES: Final = 10_000
# So many entries at once make one product large enough to be fast.
BATCH: Final = 8
Weights = NDArray[np.float32]
Booleans = NDArray[np.bool_]


def generator_of(digest: str, *, purpose: str) -> np.random.Generator:
    """Return the random numbers of a ground truth's revision, by purpose."""
    seed = hashlib.sha256(f"{purpose} {digest}".encode()).digest()
    return np.random.default_rng(int.from_bytes(seed))


def by_units(rows: Floats, units: Units) -> Floats:
    """Sum rows of recordings (…, G, columns) to rows of their units (…, U, columns)."""
    if units.kind == RECORDING:
        return rows
    index = np.array(units.index)
    order = np.argsort(index, kind="stable")
    first = np.searchsorted(index[order], np.arange(len(units)))
    return np.asarray(np.add.reduceat(rows[..., order, :], first, axis=-2))


def degrees_of(counts: Floats) -> Floats:
    """Compute the effective number of units (Σn²)² / Σn⁴ of each column of `counts` (G, columns)."""
    # Satterthwaite's degrees of freedom of a variance that sums one square per unit with weights n².
    squares, fourths = (counts**2).sum(axis=0), (counts**4).sum(axis=0)
    return np.asarray(np.divide(squares**2, fourths, out=np.zeros_like(squares), where=fourths > 0))


def usable_columns(counts: Floats) -> Booleans:
    """Find the columns of `counts` (G, columns) with at least 8 degrees of freedom."""
    return np.asarray(degrees_of(counts) >= MIN_DEGREES)


class Bootstrap:
    """The shared weights of one ground truth; `counts` is (G, columns), sequences per unit."""

    def __init__(self, counts: Floats, *, rng: np.random.Generator, n_resamples: int = N_RESAMPLES) -> None:
        self._counts = counts
        self._n = counts.sum(axis=0)
        # Units in rows: a product with sums is then contiguous in the resamples.
        self._weights: Weights = np.ascontiguousarray(
            rng.standard_exponential((n_resamples, len(counts)), dtype=np.float32).T
        )

    @cached_property
    def usable(self) -> Booleans:
        return usable_columns(self._counts)

    @cached_property
    def _tails(self) -> Floats:
        """Compute the share beyond either end of an interval, by column: below 2.5% for few units."""
        # (Σn)² / Σn² units of equal size for the mean, `degrees_of` for its error.
        squares = (self._counts**2).sum(axis=0)
        effective = np.divide(self._n**2, squares, out=np.ones_like(squares), where=squares > 0)
        pairs = zip(effective.tolist(), degrees_of(self._counts).tolist(), strict=True)
        return np.array([_tail(n, degrees=degrees) for n, degrees in pairs])

    @cached_property
    def _inverse_counts(self) -> Weights:
        weighted = self._counts.T.astype(np.float32) @ self._weights
        return np.asarray(1 / weighted[self.usable])

    def means(self, sums: Floats) -> Floats:
        """Compute θ of every column from sums (…, G, columns); NaN without sequences."""
        with np.errstate(invalid="ignore"):
            return np.asarray(sums.sum(axis=-2) / self._n)

    def deviations(self, sums: Floats) -> Weights:
        """Compute θ⁽ᵇ⁾ − θ of the usable columns, float32 (entries, usable, B)."""
        # Σw(S − θn) / Σwn: centred before the product, so that a large θ costs no precision.
        centred = (sums - self.means(sums)[:, None, :] * self._counts)[:, :, self.usable]
        rows = np.ascontiguousarray(centred.transpose(0, 2, 1), dtype=np.float32)
        weighted = rows.reshape(-1, rows.shape[2]) @ self._weights
        shaped = weighted.reshape(*rows.shape[:2], -1)
        return np.asarray(np.multiply(shaped, self._inverse_counts, out=shaped))

    def intervals(self, sums: Floats) -> tuple[Floats, Floats]:
        """Compute 95% intervals of N entries by `sums` (N, G, columns): two (N, columns), NaN if absent.

        An interval is absent in columns that are not usable, and where fewer than 6 units have an error.
        """
        # The shape of the product is fixed, so that an interval never depends on other entries of the board.
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
        is_absent = np.count_nonzero(sums, axis=1) < MIN_DIFFERENT
        low[is_absent], high[is_absent] = np.nan, np.nan
        return low, high


def _tail(n_effective: float, *, degrees: float) -> float:
    """Compute the share of resamples beyond either end of a 95% interval of `n_effective` equal units.

    >>> round(_tail(1e9, degrees=1e9), 4), round(_tail(100.0, degrees=99.0), 4)
    (0.025, 0.0231)
    >>> round(_tail(20.0, degrees=10.0), 4)
    0.0111
    """
    # Φ(−t(97.5%) · √(n / (n − 1))), the expanded percentiles of Hesterberg (The American Statistician 69,
    # 2015), with Student's t. Below 8 degrees there is no interval, so both numbers are at least 3 here.
    n = max(n_effective, 3.0)
    return NormalDist().cdf(-_student(max(degrees, 3.0)) * (n / (n - 1)) ** 0.5)


def _student(degrees: float) -> float:
    """Compute the 97.5% point of Student's distribution, to 0.00003 for 8 degrees of freedom or more.

    >>> round(_student(8.0), 4), round(_student(19.0), 4)
    (2.306, 2.093)
    """
    # Expansion of Fisher and Cornish (Technometrics 2, 1960) to the fourth order.
    z = NormalDist().inv_cdf((1 + CONFIDENCE) / 2)
    orders = (
        (z**3 + z) / 4,
        (5 * z**5 + 16 * z**3 + 3 * z) / 96,
        (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384,
        (79 * z**9 + 776 * z**7 + 1482 * z**5 - 1920 * z**3 - 945 * z) / 92_160,
    )
    return z + sum(order / degrees**power for power, order in enumerate(orders, 1))


def _ends(deviations: Weights, *, tail: float) -> Floats:
    """Compute the quantiles `tail` and 1 − `tail` of every row, (2, rows), as `numpy.quantile` does."""
    last = deviations.shape[1] - 1
    positions = [tail * last, (1 - tail) * last]
    indices = sorted({i for position in positions for i in (int(position), min(int(position) + 1, last))})
    parted = np.partition(deviations, indices, axis=1)
    quantiles = []
    for position in positions:
        i = int(position)
        lower, upper = parted[:, i].astype(np.float64), parted[:, min(i + 1, last)].astype(np.float64)
        quantiles.append(lower + (upper - lower) * (position - i))
    return np.stack(quantiles)


def bootstrap_of(truth_digest: str, counts: Floats) -> Bootstrap:
    return Bootstrap(counts, rng=generator_of(truth_digest, purpose="weights"))
