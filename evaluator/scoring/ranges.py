"""Rank ranges: all pairs of a column compared at once, with quoted rows.

A quoted row comes from a paper, without recordings: its printed 14.8 may be anything from 14.75 to 14.85. It
takes part as an entry with the sum v n_g in recording g, v being the upper end when an entry is tested as
worse and the lower end when tested as better, so a finding holds for every value in between. It is a mean
over recordings too: its own 95% interval is taken to be as wide as that of the entry, and a finding has to
hold at the end of it as well. Two quoted rows are never compared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from statistics import NormalDist
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluator.metrics.scale import Floats
from evaluator.scoring.balance import tangents
from evaluator.scoring.significance import MIN_DIFFERENT
from evaluator.scoring.uncertainty import CONFIDENCE, Booleans, Weights

Integers = NDArray[np.int64]
Indices = NDArray[np.intp]

N_RANK_FLIPS: Final = 2_000
"""All pairs are compared at once, 19,900 of 200 entries; their critical value is read from so many draws."""

# Of a 95% interval, in standard errors.
_HALF_WIDTH: Final = NormalDist().inv_cdf((1 + CONFIDENCE) / 2)
# Beside an entry's own sum of squares, what is below this is left of rounding: the pair is alike.
_ALIKE: Final = 1e-12
# The same of the difference in one recording: it is none.
_NOTHING: Final = 1e-24
# Of a signed sum in float32, the variance of its rounding beside the entry's sum of squares, with room.
_ROUNDING: Final = 1e-10
# Of a float64: sums that are multiples of the last of so many digits are added without rounding.
_DIGITS: Final = 52
# Of a statistic in float32.
_TIE: Final = 1e-4
# So many rows are measured against all before them, until others may use the processor.
_ROWS: Final = 16
# So many pairs of one row are measured at once.
_PAIRS: Final = 128
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
    second. In each column, a balanced step-down test of all paired differences (Romano and Wolf, Annals of
    Statistics 38, 2010; Mogstad, Romano, Shaikh and Wilhelm, Review of Economic Studies 91, 2024) gives the
    range from 1 + (rows significantly better) to rows − (rows significantly worse); all ranges hold the true
    ranks with 95% probability. A pair's statistic says how rare ΣD_g is among its own sign flips
    (`evaluator.scoring.balance`); the flips of all pairs together give the bound. Equal published values
    never differ significantly, so a range holds the published rank, and neither do pairs that differ in fewer
    than 6 recordings.
    """
    low, high = np.zeros((2, *published.shape), dtype=np.int64)
    drawn = rng.integers(0, 2, size=(N_RANK_FLIPS, sums.shape[1]), dtype=np.int8)
    signs = np.ascontiguousarray(drawn.T, dtype=np.float64) * 2 - 1
    for column in np.flatnonzero(usable).tolist():
        present = np.flatnonzero(np.isfinite(published[:, column]))
        if present.size:
            rows = _rows(sums[present, :, column], published[present, column], quoted, column)
            significant = _significant(rows, signs, between)
            n_better, n_worse = (
                np.bincount(side, minlength=len(rows.values))[: len(present)]
                for side in (significant.worse, significant.better)
            )
            low[present, column] = 1 + n_better
            high[present, column] = np.count_nonzero(rows.kind != _LOWER_END) - n_worse
    return RankRanges(low, high)


@dataclass(frozen=True, eq=False)
class _Rows:
    """The rows of a column: entries, then both ends of quoted rows. `sums` are (n, G).

    `margins` are what half a 95% interval adds to the total of an entry, (n,).
    """

    sums: Floats
    values: Floats
    kind: Integers
    margins: Floats

    @cached_property
    def totals(self) -> Floats:
        return np.asarray(self.sums.sum(axis=1))

    @cached_property
    def squares(self) -> Floats:
        return np.asarray(np.einsum("ng,ng->n", self.sums, self.sums))

    @cached_property
    def n_failing(self) -> Integers:
        return np.asarray(np.count_nonzero(self.sums, axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    """Pairs of rows: the worse one, how rare its sum is, and how that follows from sums; all (n,)."""

    # A sum T has the statistic slope · T + offset. It is 0 where neither can be worse. The opposite of a
    # two-sided pair takes part in the maximum as well.

    worse: NDArray[np.int32]
    better: NDArray[np.int32]
    statistic: Weights
    slope: Weights
    offset: Weights
    is_two_sided: Booleans

    def of(self, chosen: NDArray[np.intp] | slice) -> _Pairs:
        return _Pairs(*(getattr(self, name)[chosen] for name in _Pairs.__slots__))


def _rows(sums: Floats, values: Floats, quoted: Quoted | None, column: int) -> _Rows:
    kinds, margins = np.full(len(values), _ENTRY), np.zeros(len(values))
    if quoted is not None:
        margins = _margins(sums, quoted.counts[:, column])
        present = np.isfinite(quoted.values[:, column])
        half = quoted.half_widths[present, column]
        for kind in (_UPPER_END, _LOWER_END):
            ends = quoted.values[present, column] + kind * half
            sums = np.concatenate([sums, ends[:, None] * quoted.counts[:, column]])
            values = np.concatenate([values, ends])
            kinds = np.concatenate([kinds, np.full(len(ends), kind)])
    return _Rows(_exact(sums), values, kinds, margins)


def _margins(sums: Floats, counts: Floats) -> Floats:
    """Compute half the width of normal 95% intervals of entries, times the number of sequences."""
    means = sums.sum(axis=1) / counts.sum()
    residuals = sums - means[:, None] * counts
    return np.asarray(_HALF_WIDTH * np.sqrt(np.einsum("ng,ng->n", residuals, residuals)))


def _exact(sums: Floats) -> Floats:
    """Round sums (n, G) to multiples of a power of two, so that no signed sum of them is rounded."""
    # Only the last of 52 binary digits of Σ|S| is lost. Ranges then do not depend on the order of entries.
    _, exponents = np.frexp(np.abs(sums).sum(axis=1, keepdims=True))
    return np.asarray(np.ldexp(np.rint(np.ldexp(sums, _DIGITS - exponents)), exponents - _DIGITS))


def _significant(rows: _Rows, signs: Floats, between: Callable[[], None]) -> _Pairs:
    """Find the pairs that differ significantly, by step-down over all pairs."""
    n_entries = int(np.count_nonzero(rows.kind == _ENTRY))
    level, blocks = _level(n_entries, len(rows.kind) - n_entries), []
    for later in range(len(rows.values)):
        if later % _ROWS == 0:
            between()
        for start in range(0, later + 1, _PAIRS):
            # Entries come first: two quoted rows are no pair.
            stop = min(start + _PAIRS, later, n_entries)
            blocks.append(_measured(rows, later, slice(start, max(start, stop)), level))
    parts = (np.concatenate([getattr(each, name) for each in blocks]) for name in _Pairs.__slots__)
    pairs = _Pairs(*parts)
    pairs = pairs.of(np.argsort(pairs.statistic, kind="stable"))
    turned = (rows.sums @ signs).astype(np.float32)
    up_to = _largest_up_to(turned, pairs, between)
    n_left, critical = len(pairs.statistic), _critical(up_to[-1])
    while (n_now := int(np.searchsorted(pairs.statistic, critical, side="right"))) < n_left:
        n_left = n_now
        n_whole = n_left // _BLOCK
        rest, _ = _largest(turned, pairs.of(slice(n_whole * _BLOCK, n_left)))
        critical = _critical(np.maximum(up_to[n_whole], rest))
    return pairs.of(slice(n_left, None))


def _level(n_entries: int, n_ends: int) -> float:
    """Return the bound of as many independent normal pairs (Bonferroni): near the one that will be found."""
    n_tests = n_entries * (n_entries - 1 + n_ends)
    return NormalDist().inv_cdf(1 - (1 - CONFIDENCE) / max(n_tests, 1))


def _measured(rows: _Rows, later: int, earlier: slice, level: float) -> _Pairs:
    """Measure the pairs of a row with some entries before it."""
    each = rows.sums[later] - rows.sums[earlier]
    each *= each
    squares, fourths = each.sum(axis=1), np.einsum("ng,ng->n", each, each)
    largest = np.maximum(rows.squares[later], rows.squares[earlier])
    is_alike = squares <= _ALIKE * largest
    squares[is_alike] = 1.0
    tangent = tangents(each, squares, fourths, level=level, noise=_ROUNDING * largest / squares)
    slope, offset = tangent.slope, tangent.offset
    # There are at least (ΣD²)² / ΣD⁴ units with a difference.
    is_few = is_alike | (squares**2 < MIN_DIFFERENT * fourths)
    if rows.kind[later] != _ENTRY:
        is_few[:] = True
    few = np.flatnonzero(is_few)
    too_few = few[is_alike[few] | (_n_different(rows, later, earlier, each, few) < MIN_DIFFERENT)]
    slope[too_few], offset[too_few] = 0.0, 0.0
    totals = rows.totals[later] - rows.totals[earlier]
    # Of an entry and an end of a quoted row only one may be called worse; of two entries that with the
    # larger value, and of two that are published alike neither.
    if rows.kind[later] != _ENTRY:
        totals = np.copysign(np.maximum(np.abs(totals) - rows.margins[earlier], 0), totals)
    side = rows.kind[earlier] - rows.kind[later]
    order = np.sign(rows.values[later] - rows.values[earlier])
    totals[~((order * totals > 0) & ((side == 0) | (side == order)))] = 0.0
    is_later_worse = np.where(totals == 0, side >= 0, totals > 0)
    other = np.arange(earlier.start, earlier.stop)
    return _Pairs(
        worse=np.where(is_later_worse, later, other).astype(np.int32),
        better=np.where(is_later_worse, other, later).astype(np.int32),
        statistic=np.where(totals == 0, 0.0, slope * np.abs(totals) + offset).astype(np.float32),
        slope=slope.astype(np.float32),
        offset=offset.astype(np.float32),
        is_two_sided=side == 0,
    )


def _n_different(rows: _Rows, later: int, earlier: slice, squares: Floats, chosen: Indices) -> Integers:
    """Count the units in which the rows of each pair differ; with a quoted row, those with an error."""
    if rows.kind[later] != _ENTRY:
        return np.asarray(rows.n_failing[earlier][chosen])
    nothing = _NOTHING * np.maximum(rows.squares[later], rows.squares[earlier])[chosen]
    # A sum of floats is faster than a count in each row.
    is_different = squares[chosen] > nothing[:, None]
    return np.asarray(is_different.astype(np.float32).sum(axis=1), dtype=np.int64)


def _largest_up_to(turned: Weights, pairs: _Pairs, between: Callable[[], None]) -> Weights:
    """Compute each draw's largest statistic over the first 0, 1, 2, … blocks, and over all opposites."""
    rises = [np.zeros(turned.shape[1], dtype=np.float32)]
    opposite = rises[0]
    for start in range(0, len(pairs.statistic), _BLOCK):
        between()
        rise, fall = _largest(turned, pairs.of(slice(start, start + _BLOCK)))
        rises.append(np.maximum(rises[-1], rise))
        opposite = np.maximum(opposite, fall)
    return np.maximum(np.stack(rises), opposite)


def _largest(turned: Weights, pairs: _Pairs) -> tuple[Weights, Weights]:
    """Find each draw's largest statistic of the pairs and of their two-sided opposites; both at least 0."""
    rise, fall = np.zeros((2, turned.shape[1]), dtype=np.float32)
    opposite = np.where(pairs.is_two_sided, pairs.offset, -np.inf).astype(np.float32)
    for first in range(0, turned.shape[1], _DRAWS):
        draws = slice(first, first + _DRAWS)
        some = np.ascontiguousarray(turned[:, draws])
        for start in range(0, len(pairs.statistic), _CELLS // _DRAWS):
            rows = slice(start, start + _CELLS // _DRAWS)
            part = pairs.of(rows)
            sums = some[part.worse]
            sums -= some[part.better]
            sums *= part.slope[:, None]
            other = opposite[rows, None] - sums
            sums += part.offset[:, None]
            np.maximum(rise[draws], sums.max(axis=0), out=rise[draws])
            np.maximum(fall[draws], other.max(axis=0), out=fall[draws])
    return rise, fall


def _critical(largest: Weights) -> np.float32:
    # What is above by rounding alone is as large.
    return np.float32(np.quantile(largest, CONFIDENCE, method="higher") + _TIE)
