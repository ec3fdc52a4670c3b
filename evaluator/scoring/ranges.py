"""Rank ranges: all pairs of a column compared at once, published results among them.

A quoted row was printed in a paper and has no recordings. Its value v is known as exactly as it was printed:
14.8 may have been anything from 14.75 to 14.85. In recording g an entry of exactly that value would have the
sum v n_g, so a quoted row takes part as such an entry: as one of its upper end where an entry is asked to be
worse than it, of its lower end where one is asked to be better. What is found then holds whatever the value
was before it was rounded. Two quoted rows are never compared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluator.metrics.scale import Floats
from evaluator.scoring.uncertainty import CONFIDENCE, Booleans, Weights

N_RANK_FLIPS: Final = 2_000
"""All pairs are compared at once, 19,900 of 200 entries; their critical value is read from so many draws."""

# So many float32 are a megabyte.
_CACHED: Final = 1 << 18
# Beside an entry's own sum of squares, what is below this is left of rounding: the pair is alike.
_ALIKE: Final = 1e-12

Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Quoted:
    """Rows printed in papers: `values` as printed and their `half_widths`, (rows, columns), NaN where absent.

    A value v with half width h may have been anything from v − h to v + h before it was rounded: h is 0.05
    for one decimal. `counts` (G, columns) are the sequences of each recording.
    """

    values: Floats
    half_widths: Floats
    counts: Floats


@dataclass(frozen=True, slots=True, eq=False)
class RankRanges:
    """Where each of N entries may stand in each of the columns, int64 (N, columns); 0 where there is none."""

    low: Integers
    high: Integers

    @property
    def is_with_best(self) -> Booleans:
        """Which may be the best of their column, at 95 %: those whose range begins at 1."""
        return np.asarray(self.low == 1)


def rank_ranges(
    sums: Floats,
    *,
    published: Floats,
    usable: Booleans,
    rng: np.random.Generator,
    quoted: Quoted | None = None,
    between: Callable[[], None] = lambda: None,
) -> RankRanges:
    """Rank ranges at 95 % of N entries by their `sums` (N, G, columns), of the columns that are `usable`.

    `published` (N, columns) are their values as they are ranked, NaN where an entry has none; `quoted` are
    rows from papers that are ranked among them. In each column all pairs are compared at once: step-down
    max-t over the paired differences, from 1 + (how many rows are significantly better) to the number of
    rows − (how many are significantly worse), after Mogstad, Romano, Shaikh and Wilhelm (Review of Economic
    Studies 91, 2024). With 95 % probability every range of a column holds its entry's true rank. A difference
    is studentised by its own recordings, t = ΣD_g / √ΣD_g², and what chance makes of the largest t is read
    from turning the recordings' signs, as `differences.sign_flips` does for one pair.

    Values that are published alike are never told apart, nor an entry from a quoted row whose value may have
    been rounded from the entry's: so a range holds the published rank as well, which takes quoted values as
    exact. `between` is called every fraction of a second.
    """
    low = np.zeros(published.shape, dtype=np.int64)
    high = low.copy()
    shape = (N_RANK_FLIPS, sums.shape[1])
    signs = rng.integers(0, 2, size=shape, dtype=np.int8).astype(np.float32) * 2 - 1
    for column in np.flatnonzero(usable).tolist():
        present = np.flatnonzero(np.isfinite(published[:, column]))
        if not present.size:
            continue
        rows = present[np.argsort(published[present, column], kind="stable")]
        family = _Family(sums[rows, :, column], published[rows, column], signs)
        if quoted is not None:
            family.add(quoted, column)
        family.step_down(between)
        low[rows, column] = 1 + family.n_better()
        high[rows, column] = family.n_rows - family.n_worse()
    return RankRanges(low, high)


class _Side:
    """Entries against one end of the quoted rows, `sign` +1: entries may be worse, −1: better; (N, Q)."""

    def __init__(self, sign: int, is_askable: Booleans, t: Floats, inverse: Floats, turned: Weights) -> None:
        self.sign = sign
        self.t = np.where(is_askable, sign * t, 0.0)
        self.inverse = (sign * inverse).astype(np.float32)
        self.turned = turned
        self.rejected = np.zeros(t.shape, dtype=np.bool_)


class _Family:
    """One column: entries in ascending order, quoted rows, and which hypotheses about them are rejected.

    Of the entries these are θ_b ≤ θ_a of all ordered pairs. Those with b above a can never be rejected and
    stay at every step; the others leave as they are rejected: `rejected[b, a]`, b is worse. With a
    quoted row from v − h to v + h they are θ ≤ v + h and θ ≥ v − h; with a value on the other side they, too,
    can never be rejected and stay.
    """

    def __init__(self, sums: Floats, values: Floats, signs: Weights) -> None:
        # What all have in common is in no difference, and would cost the products their digits.
        self._common = sums.mean(axis=0)
        self._own = sums - self._common
        self._values, self._signs = values, signs
        self._turned = self._own.astype(np.float32) @ signs.T
        inverse, totals = _inverse_error(self._own), self._own.sum(axis=1)
        is_askable = values[:, None] > values[None, :]
        self._t = np.where(is_askable, (totals[:, None] - totals[None, :]) * inverse, 0.0)
        self._inverse = inverse.astype(np.float32)
        self._sides: list[_Side] = []
        self.rejected = np.zeros(self._t.shape, dtype=np.bool_)
        self.n_rows = len(values)

    def add(self, quoted: Quoted, column: int) -> None:
        """Let quoted rows take part that have a value in this column."""
        is_present = np.isfinite(quoted.values[:, column])
        values, half = quoted.values[is_present, column], quoted.half_widths[is_present, column]
        self.n_rows += len(values)
        for sign in (1, -1):
            ends = values + sign * half
            sums = ends[:, None] * quoted.counts[:, column] - self._common
            inverse = _inverse_error_between(self._own, sums)
            t = (self._own.sum(axis=1)[:, None] - sums.sum(axis=1)) * inverse
            is_askable = sign * (self._values[:, None] - ends) > 0
            turned = sums.astype(np.float32) @ self._signs.T
            self._sides.append(_Side(sign, is_askable, t, inverse, turned))

    def step_down(self, between: Callable[[], None]) -> None:
        """Reject until nothing more is found."""
        up, down = self._among_entries(between)
        while True:
            largest = np.maximum(np.maximum(up, down), self._against_quoted(between))
            critical = float(np.quantile(largest, CONFIDENCE, method="higher"))
            is_found = [
                _reject(rejected, t > critical)
                for rejected, t in [(self.rejected, self._t), *((s.rejected, s.t) for s in self._sides)]
            ]
            if not any(is_found):
                return
            if is_found[0]:
                up, _ = self._among_entries(between)

    def n_better(self) -> Integers:
        """How many rows are significantly better than each entry."""
        quoted = [side.rejected.sum(axis=1) for side in self._sides if side.sign > 0]
        return np.asarray(sum(quoted, start=self.rejected.sum(axis=1)))

    def n_worse(self) -> Integers:
        """How many rows are significantly worse than each entry."""
        quoted = [side.rejected.sum(axis=1) for side in self._sides if side.sign < 0]
        return np.asarray(sum(quoted, start=self.rejected.sum(axis=0)))

    def _blocks(self, between: Callable[[], None]) -> Iterator[tuple[slice, Weights, Weights]]:
        """Draws that stay in the processor's cache: which they are, the entries' sums, and room for as many.

        All pairs at once, 19,900 × 2,000, would be 160 MB.
        """
        n_entries, n_draws = self._turned.shape
        size = max(_CACHED // n_entries, 1)
        buffer = np.empty((n_entries, size), dtype=np.float32)
        for start in range(0, n_draws, size):
            between()
            block = slice(start, min(start + size, n_draws))
            yield block, np.ascontiguousarray(self._turned[:, block]), buffer

    def _among_entries(self, between: Callable[[], None]) -> tuple[Weights, Weights]:
        """In every draw the largest studentised rise and fall over pairs a < b that are not rejected."""
        n_entries, n_draws = self._turned.shape
        up, down = np.zeros((2, n_draws), dtype=np.float32)
        partners = [a + 1 + np.flatnonzero(~self.rejected[a + 1 :, a]) for a in range(n_entries - 1)]
        for block, part, buffer in self._blocks(between):
            for a, rows in enumerate(partners):
                if rows.size:
                    rises = _rises(part, part[a], rows, self._inverse[a, rows], buffer)
                    np.maximum(up[block], rises.max(axis=0), out=up[block])
                    np.maximum(down[block], -rises.min(axis=0), out=down[block])
        return up, down

    def _against_quoted(self, between: Callable[[], None]) -> Weights:
        """In every draw the largest studentised rise against quoted rows that is not rejected."""
        up = np.zeros(self._turned.shape[1], dtype=np.float32)
        if not self._sides:
            return up
        for block, part, buffer in self._blocks(between):
            for side in self._sides:
                for i, turned in enumerate(side.turned):
                    rows = np.flatnonzero(~side.rejected[:, i])
                    if rows.size:
                        rises = _rises(part, turned[block], rows, side.inverse[rows, i], buffer)
                        np.maximum(up[block], rises.max(axis=0), out=up[block])
        return up


def _reject(rejected: Booleans, found: Booleans) -> bool:
    """Add what was found to what is rejected; whether any of it is new."""
    is_new = bool((found & ~rejected).any())
    np.logical_or(rejected, found, out=rejected)
    return is_new


def _rises(part: Weights, low: Weights, rows: Integers, inverse: Weights, buffer: Weights) -> Weights:
    """How far some rows of `part` (N, draws) rise above `low` (draws,), in standard errors; in the buffer."""
    chosen = part[rows[0] : rows[-1] + 1] if rows[-1] - rows[0] + 1 == rows.size else part[rows]
    rises = buffer[: rows.size, : part.shape[1]]
    np.subtract(chosen, low, out=rises)
    return np.multiply(rises, inverse[:, None], out=rises)


def _inverse_error(sums: Floats) -> Floats:
    """1 / √ΣD² of every pair, (N, N); 0 for pairs that are alike."""
    return _inverse_error_between(sums, sums)


def _inverse_error_between(first: Floats, second: Floats) -> Floats:
    """1 / √ΣD² of N with M, (N, M), with ΣD² = Q_aa + Q_bb − 2 Q_ab; 0 for pairs that are alike."""
    one, other = (np.einsum("ng,ng->n", sums, sums)[:, None] for sums in (first, second))
    squares = one + other.T - 2 * first @ second.T
    is_alike = squares <= _ALIKE * np.maximum(one, other.T)
    return np.where(is_alike, 0.0, 1 / np.sqrt(np.where(is_alike, 1.0, squares)))
