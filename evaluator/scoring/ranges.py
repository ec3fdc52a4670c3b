"""Rank ranges: all pairs of a column compared at once, with quoted rows.

A quoted row comes from a paper, without recordings: its printed 14.8 may be anything from 14.75 to 14.85. It
takes part as an entry with the sum v n_g in recording g, v being the upper end when an entry is tested as
worse and the lower end when tested as better, so a finding holds for every value in between. Two quoted rows
are never compared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluator.metrics.scale import Floats
from evaluator.scoring.uncertainty import CONFIDENCE, Booleans, Weights

Integers = NDArray[np.int64]

N_RANK_FLIPS: Final = 2_000
"""All pairs are compared at once, 19,900 of 200 entries; their critical value is read from so many draws."""

# Beside an entry's own sum of squares, what is below this is left of rounding: the pair is alike.
_ALIKE: Final = 1e-12
# Of a float64: sums that are multiples of the last of so many digits are added without rounding.
_DIGITS: Final = 52
# So many rows of all pairs are measured at once.
_ROWS: Final = 256
# So many pairs, times all draws, are a fraction of a second of work.
_BLOCK: Final = 1 << 13
# So many float32 stay in the processor's cache.
_CELLS: Final = 1 << 16
_DRAWS: Final = 250

_ENTRY: Final = 0
# Of a quoted row's value: entries may be worse than its upper end, and better than its lower end.
_UPPER_END: Final = 1
_LOWER_END: Final = -1


@dataclass(frozen=True, slots=True, eq=False)
class Quoted:
    """Rows of papers: `values` ± `half_widths` (rows, columns), NaN if absent; `counts` (G, columns)."""

    # The half width of a value with one decimal is 0.05.

    values: Floats
    half_widths: Floats
    counts: Floats


@dataclass(frozen=True, slots=True, eq=False)
class RankRanges:
    """Lowest and highest rank of N entries in each column, int64 (N, columns); 0 if absent."""

    low: Integers
    high: Integers

    @property
    def is_with_best(self) -> Booleans:
        """Whether the range begins at 1."""
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
    """Compute 95% rank ranges of N entries by `sums` (N, G, columns), in the `usable` columns.

    `published` (N, columns) are the ranked values, NaN where absent; `between` is called every fraction of a
    second. In each column, step-down max-t over all paired differences (Mogstad, Romano, Shaikh and Wilhelm,
    Review of Economic Studies 91, 2024) gives the range from 1 + (rows significantly better) to rows − (rows
    significantly worse); all ranges hold the true ranks with 95% probability. t = ΣD_g / √ΣD_g², its null
    distribution comes from sign flips. Equal published values never differ significantly, so a range holds
    the published rank.
    """
    low, high = np.zeros((2, *published.shape), dtype=np.int64)
    drawn = rng.integers(0, 2, size=(N_RANK_FLIPS, sums.shape[1]), dtype=np.int8)
    signs = np.ascontiguousarray(drawn.T, dtype=np.float64) * 2 - 1
    for column in np.flatnonzero(usable).tolist():
        present = np.flatnonzero(np.isfinite(published[:, column]))
        if present.size:
            rows = _rows(sums[present, :, column], published[present, column], quoted, column)
            n_better, n_worse = _count_significant(rows, signs, between)
            low[present, column] = 1 + n_better[: len(present)]
            n_rows = np.count_nonzero(rows.kind != _LOWER_END)
            high[present, column] = n_rows - n_worse[: len(present)]
    return RankRanges(low, high)


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """The rows of a column: entries, then both ends of quoted rows. `sums` are (n, G)."""

    sums: Floats
    values: Floats
    kind: Integers


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    """Pairs of rows: the worse one, by how many standard errors t, and 1 / √ΣD²; all (n,)."""

    # t is 0 where neither can be worse. The opposite of a two-sided pair takes part in the maximum as well.

    worse: NDArray[np.int32]
    better: NDArray[np.int32]
    t: Weights
    inverse: Weights
    is_two_sided: Booleans

    def of(self, chosen: NDArray[np.intp] | slice) -> _Pairs:
        return _Pairs(*(getattr(self, name)[chosen] for name in _Pairs.__slots__))


def _rows(sums: Floats, values: Floats, quoted: Quoted | None, column: int) -> _Rows:
    kinds = np.full(len(values), _ENTRY)
    if quoted is not None:
        present = np.isfinite(quoted.values[:, column])
        half = quoted.half_widths[present, column]
        for kind in (_UPPER_END, _LOWER_END):
            ends = quoted.values[present, column] + kind * half
            sums = np.concatenate([sums, ends[:, None] * quoted.counts[:, column]])
            values = np.concatenate([values, ends])
            kinds = np.concatenate([kinds, np.full(len(ends), kind)])
    return _Rows(_exact(sums), values, kinds)


def _exact(sums: Floats) -> Floats:
    """Round sums (n, G) to multiples of a power of two, so that no signed sum of them is rounded."""
    # Only the last of 52 binary digits of Σ|S| is lost. Ranges then do not depend on the order of entries.
    _, exponents = np.frexp(np.abs(sums).sum(axis=1, keepdims=True))
    return np.asarray(np.ldexp(np.rint(np.ldexp(sums, _DIGITS - exponents)), exponents - _DIGITS))


def _count_significant(rows: _Rows, signs: Floats, between: Callable[[], None]) -> tuple[Integers, Integers]:
    """Count the rows significantly better and worse than each row, by step-down over all pairs."""
    blocks = []
    for start in range(0, len(rows.values), _ROWS):
        between()
        blocks.append(_measured(rows, start))
    parts = (np.concatenate([getattr(each, name) for each in blocks]) for name in _Pairs.__slots__)
    pairs = _Pairs(*parts)
    pairs = pairs.of(np.argsort(pairs.t, kind="stable"))
    turned = (rows.sums @ signs).astype(np.float32)
    up_to = _largest_up_to(turned, pairs, between)
    n_left, critical = len(pairs.t), _critical(up_to[-1])
    while (n_now := int(np.searchsorted(pairs.t, np.float32(critical), side="right"))) < n_left:
        n_left = n_now
        n_whole = n_left // _BLOCK
        rest, _ = _largest(turned, pairs.of(slice(n_whole * _BLOCK, n_left)))
        critical = _critical(np.maximum(up_to[n_whole], rest))
    n = len(rows.values)
    return np.bincount(pairs.worse[n_left:], minlength=n), np.bincount(pairs.better[n_left:], minlength=n)


def _measured(rows: _Rows, start: int) -> _Pairs:
    # By ΣD² = Q_aa + Q_bb − 2 Q_ab.
    own = rows.sums[start : start + _ROWS]
    stop = start + len(own)
    nth, earlier = np.tril_indices(len(own), start - 1, stop)
    later = nth + start
    is_pair = (rows.kind[later] == _ENTRY) | (rows.kind[earlier] == _ENTRY)
    nth, later, earlier = nth[is_pair], later[is_pair], earlier[is_pair]
    squares, totals = np.einsum("ng,ng->n", rows.sums, rows.sums), rows.sums.sum(axis=1)
    gaps = squares[later] + squares[earlier] - 2 * (own @ rows.sums[:stop].T)[nth, earlier]
    is_alike = gaps <= _ALIKE * np.maximum(squares[later], squares[earlier])
    inverse = np.where(is_alike, 0.0, 1 / np.sqrt(np.where(is_alike, 1.0, gaps)))
    t = (totals[later] - totals[earlier]) * inverse
    # Of an entry and an end of a quoted row only one may be called worse; of two entries that with the
    # larger value, and of two that are published alike neither.
    side = rows.kind[earlier] - rows.kind[later]
    order = np.sign(rows.values[later] - rows.values[earlier])
    t[~((order * t > 0) & ((side == 0) | (side == order)))] = 0.0
    is_later_worse = np.where(t == 0, side >= 0, t > 0)
    return _Pairs(
        worse=np.where(is_later_worse, later, earlier).astype(np.int32),
        better=np.where(is_later_worse, earlier, later).astype(np.int32),
        t=np.abs(t).astype(np.float32),
        inverse=inverse.astype(np.float32),
        is_two_sided=side == 0,
    )


def _largest_up_to(turned: Weights, pairs: _Pairs, between: Callable[[], None]) -> Weights:
    """Compute for every draw the largest t over the first 0, 1, 2, … blocks, and over all opposites."""
    rises = [np.zeros(turned.shape[1], dtype=np.float32)]
    opposite = rises[0]
    for start in range(0, len(pairs.t), _BLOCK):
        between()
        rise, fall = _largest(turned, pairs.of(slice(start, start + _BLOCK)))
        rises.append(np.maximum(rises[-1], rise))
        opposite = np.maximum(opposite, fall)
    return np.maximum(np.stack(rises), opposite)


def _largest(turned: Weights, pairs: _Pairs) -> tuple[Weights, Weights]:
    """Find for each draw the largest t of the pairs and of their two-sided opposites; both at least 0."""
    rise, fall = np.zeros((2, turned.shape[1]), dtype=np.float32)
    for first in range(0, turned.shape[1], _DRAWS):
        draws = slice(first, first + _DRAWS)
        some = np.ascontiguousarray(turned[:, draws])
        for start in range(0, len(pairs.t), _CELLS // _DRAWS):
            part = pairs.of(slice(start, start + _CELLS // _DRAWS))
            rises = some[part.worse] - some[part.better]
            rises *= part.inverse[:, None]
            rise[draws] = np.maximum(rise[draws], rises.max(axis=0))
            fall[draws] = np.maximum(fall[draws], -rises[part.is_two_sided].min(axis=0, initial=0))
    return rise, fall


def _critical(largest: Weights) -> float:
    return float(np.quantile(largest, CONFIDENCE, method="higher"))
