"""All pairs of one column of a board, kept so that an entry more or less costs its own pairs alone.

What chance makes of the largest t over many pairs is a maximum, and a maximum is quickly told of one pair
more. Pairs are sorted by t into buckets, and of each bucket the largest rise in every draw of signs is kept.
The maximum over all pairs with t ≤ c is then that of a few whole buckets and of the pairs in the bucket that
c cuts. A pair that leaves takes the maxima along that it held; those alone are made anew.

Whatever is kept is the same, bit for bit, in whatever order entries came and went: an entry's sums are
rounded to so many binary digits that no turned sum of them has to be rounded, and a pair's numbers are
functions of its two entries.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluator.metrics.scale import Floats
from evaluator.scoring.uncertainty import CONFIDENCE, Booleans, Weights

Integers = NDArray[np.int64]
Slots = NDArray[np.intp]

# Beside an entry's own sum of squares, what is below this is left of rounding: the pair is alike.
_ALIKE: Final = 1e-12
# Of a float64: sums that are multiples of the last of so many digits are added without rounding.
_DIGITS: Final = 52
# Buckets of t: one for what is never rejected, one below 2, steps of 0.04 up to 7, and one for the rest.
_NEVER: Final = 0
_FIRST: Final = 2.0
_STEPS_PER_UNIT: Final = 25
_N_BUCKETS: Final = 128
# So many pairs are a moment's work: a fraction of a second.
_MOMENT: Final = 1 << 17
# So many float32 stay in the processor's cache; where pairs are many, so many draws of them at once.
_CELLS: Final = 1 << 16
_DRAWS: Final = 250
_FEW: Final = 1 << 14
# So many rows of all pairs are looked through at once.
_ROWS: Final = 512

ENTRY: Final = 0
UPPER_END: Final = 1
"""Of a quoted row's value: entries may be worse than it."""
LOWER_END: Final = -1
"""Of a quoted row's value: entries may be better than it."""


class Pairs:
    """One column: its entries and ends of quoted rows in numbered slots, and all pairs of them.

    `signs` (G, D) are the draws, −1 or 1. Of two slots `_pairs` has t below the diagonal, positive where the
    later slot is the worse one and 0 where neither can be rejected, and 1 / √ΣD² above it.
    """

    def __init__(self, signs: Floats, *, n_slots: int) -> None:
        self._signs = signs
        n_recordings, n_draws = signs.shape
        self._is_taken = np.zeros(n_slots, dtype=np.bool_)
        self._kind = np.zeros(n_slots, dtype=np.int8)
        self._value, self._total, self._square = np.zeros((3, n_slots))
        self._sums = np.zeros((n_slots, n_recordings))
        self._turned = np.zeros((n_slots, n_draws), dtype=np.float32)
        self._pairs = np.zeros((n_slots, n_slots), dtype=np.float32)
        self._largest = np.zeros((_N_BUCKETS, n_draws), dtype=np.float32)

    @property
    def nbytes(self) -> int:
        """What it takes of memory, but for the signs."""
        return sum(part.nbytes for part in (self._sums, self._turned, self._pairs, self._largest))

    @staticmethod
    def nbytes_of(n_slots: int, *, n_recordings: int, n_draws: int) -> int:
        """What so many slots take."""
        return 8 * n_slots * n_recordings + 4 * n_draws * (n_slots + _N_BUCKETS) + 4 * n_slots**2

    @property
    def is_entry(self) -> Booleans:
        """Which slots hold an entry."""
        return np.asarray(self._is_taken & (self._kind == ENTRY))

    @property
    def n_rows(self) -> int:
        """How many rows it has, quoted ones counted once."""
        return int(np.count_nonzero(self._is_taken & (self._kind != LOWER_END)))

    def reserve(self, n_slots: int) -> None:
        """Make room for slots up to this number."""
        n_before = len(self._kind)
        if n_slots <= n_before:
            return
        for name in ("_is_taken", "_kind", "_value", "_total", "_square", "_sums", "_turned"):
            before = getattr(self, name)
            grown = np.zeros((n_slots, *before.shape[1:]), dtype=before.dtype)
            grown[:n_before] = before
            setattr(self, name, grown)
        pairs = np.zeros((n_slots, n_slots), dtype=np.float32)
        pairs[:n_before, :n_before] = self._pairs
        self._pairs = pairs

    def add(
        self, slots: Slots, *, sums: Floats, values: Floats, kind: int, between: Callable[[], None]
    ) -> None:
        """Let entries, or ends of quoted rows, take part in free slots, by their `sums` (n, G)."""
        for some in self._blocks(slots):
            between()
            self._take(slots[some], sums[some], values[some], kind)
            self._measure(slots[some])
            self._raise(self._largest, self._pairs_of(slots[some]))

    def remove(self, slots: Slots, *, between: Callable[[], None]) -> None:
        """Empty these slots, and make the maxima anew that their pairs held."""
        slots = slots[self._is_taken[slots]]
        held = np.zeros_like(self._largest)
        for some in self._blocks(slots):
            between()
            self._raise(held, self._pairs_of(slots[some]))
        self._pairs[slots], self._pairs[:, slots] = 0, 0
        self._is_taken[slots] = False
        self._make_anew((held == self._largest) & (held > 0), between)

    def step_down(self, *, between: Callable[[], None]) -> float:
        """The critical value at which nothing more is found: pairs with a larger t are told apart."""
        up_to = np.maximum.accumulate(self._largest, axis=0)
        critical = _critical(up_to[-1])
        n_found = self._n_beyond(critical)
        while n_found:
            between()
            cut = max(int(_buckets(np.array([critical], dtype=np.float32))[0]), 1)
            largest = np.maximum(up_to[cut - 1], self._largest_within(cut, critical))
            critical = _critical(largest)
            n_before, n_found = n_found, self._n_beyond(critical)
            if n_found == n_before:
                break
        return critical

    def told_apart(self, critical: float) -> tuple[Integers, Integers]:
        """Of every slot, how many rows are significantly better, and how many worse."""
        n_better, n_worse = np.zeros((2, len(self._kind)), dtype=np.int64)
        for start, t in self._triangle():
            rows, others = slice(start, start + len(t)), slice(t.shape[1])
            is_worse, is_better = t > critical, t < -critical
            n_better[rows] += is_worse.sum(axis=1)
            n_worse[others] += is_worse.sum(axis=0)
            n_worse[rows] += is_better.sum(axis=1)
            n_better[others] += is_better.sum(axis=0)
        return n_better, n_worse

    # --- entries and pairs -------------------------------------------------------------------------------

    def _blocks(self, slots: Slots) -> Iterator[slice]:
        """So many of these slots at once as have a moment's work of pairs."""
        size = max(_MOMENT // len(self._kind), 1)
        return (slice(start, start + size) for start in range(0, len(slots), size))

    def _take(self, slots: Slots, sums: Floats, values: Floats, kind: int) -> None:
        exact = _exact(sums)
        self._is_taken[slots] = True
        self._kind[slots], self._value[slots], self._sums[slots] = kind, values, exact
        self._total[slots] = exact.sum(axis=1)
        self._square[slots] = np.einsum("ng,ng->n", exact, exact)
        self._turned[slots] = exact @ self._signs

    def _measure(self, slots: Slots) -> None:
        """Fill in t and 1 / √ΣD² of all pairs of these slots, ΣD² = Q_aa + Q_bb − 2 Q_ab."""
        others = np.flatnonzero(self._is_taken)
        squares, kinds = self._square, self._kind
        products = self._sums[slots] @ self._sums[others].T
        largest = np.maximum(squares[slots][:, None], squares[others])
        gaps = squares[slots][:, None] + squares[others] - 2 * products
        is_alike = (gaps <= _ALIKE * largest) | ((kinds[slots][:, None] != 0) & (kinds[others] != 0))
        inverse = np.where(is_alike, 0.0, 1 / np.sqrt(np.where(is_alike, 1.0, gaps)))
        t = (self._total[slots][:, None] - self._total[others]) * inverse
        # Of an entry and an end of a quoted row only one may be called worse; of two entries that with the
        # larger value, and of two that are published alike neither.
        side = kinds[others] - kinds[slots][:, None]
        order = np.sign(self._value[slots][:, None] - self._value[others])
        is_askable = (order * t > 0) & ((side == 0) | (side == order))
        t[~is_askable] = 0.0
        is_later = slots[:, None] > others
        later, earlier = np.maximum(slots[:, None], others), np.minimum(slots[:, None], others)
        is_pair = later != earlier
        later, earlier = later[is_pair], earlier[is_pair]
        self._pairs[later, earlier] = np.where(is_later, t, -t)[is_pair]
        self._pairs[earlier, later] = inverse[is_pair]

    def _pairs_of(self, slots: Slots) -> _Chosen:
        """All pairs of these slots, each once."""
        others = np.flatnonzero(self._is_taken)
        own, other = np.broadcast_arrays(slots[:, None], others)
        is_pair = ~np.isin(others, slots) | (other < own)
        is_pair &= (self._kind[own] == ENTRY) | (self._kind[other] == ENTRY)
        own, other = own[is_pair], other[is_pair]
        return self._chosen(np.maximum(own, other), np.minimum(own, other))

    def _chosen(self, later: Slots, earlier: Slots) -> _Chosen:
        t = self._pairs[later, earlier]
        side = self._kind[earlier] - self._kind[later]
        # Of a pair that cannot be told apart, an end of a quoted row has its one side still.
        is_later_worse = np.where(t == 0, side >= 0, t > 0)
        return _Chosen(
            worse=np.where(is_later_worse, later, earlier),
            better=np.where(is_later_worse, earlier, later),
            inverse=self._pairs[earlier, later],
            bucket=_buckets(np.abs(t)),
            is_two_sided=side == 0,
        )

    def _triangle(self) -> Iterator[tuple[int, Weights]]:
        """t of all pairs, some rows at a time: (first row, (rows, slots up to the last row))."""
        for start in range(0, len(self._kind), _ROWS):
            rows = self._pairs[start : start + _ROWS]
            yield start, np.tril(rows[:, : start + len(rows)], start - 1)

    def _n_beyond(self, critical: float) -> int:
        return sum(int(np.count_nonzero(np.abs(t) > critical)) for _, t in self._triangle())

    # --- maxima ------------------------------------------------------------------------------------------

    def _raise(self, largest: Weights, pairs: _Chosen) -> None:
        """Raise the maxima of all buckets (buckets, D) to those of these pairs, where these are larger."""
        for is_two_sided in (True, False):
            some = pairs.of(np.flatnonzero(pairs.is_two_sided == is_two_sided))
            some = some.of(np.argsort(some.bucket, kind="stable"))
            bounds = np.searchsorted(some.bucket, np.arange(_N_BUCKETS + 1)).tolist()
            n_all = self._turned.shape[1]
            n_draws = n_all if len(some.bucket) < _FEW else _DRAWS
            size = _CELLS // n_draws
            room = np.empty((2, size, n_draws), dtype=np.float32)
            for draws in (slice(start, min(start + n_draws, n_all)) for start in range(0, n_all, n_draws)):
                turned = np.ascontiguousarray(self._turned[:, draws])
                for bucket in np.unique(some.bucket).tolist():
                    for first in range(bounds[bucket], bounds[bucket + 1], size):
                        chunk = slice(first, min(first + size, bounds[bucket + 1]))
                        rises = _rises(turned, some, chunk, room)
                        _raise_to(largest[bucket, draws], rises.max(axis=0))
                        if is_two_sided:
                            _raise_to(largest[_NEVER, draws], -rises.min(axis=0))

    def _largest_within(self, bucket: int, critical: float) -> Weights:
        """In every draw the largest rise over the pairs of a bucket with t up to this value."""
        largest = np.zeros_like(self._largest)
        above = _FIRST + (bucket - 3) / _STEPS_PER_UNIT if bucket > 1 else 0.0
        for start, t in self._triangle():
            sizes = np.abs(t)
            later, earlier = np.nonzero((sizes > above) & (sizes <= critical))
            pairs = self._chosen(later + start, earlier)
            self._raise(largest, pairs.of(np.flatnonzero(pairs.bucket == bucket)))
        return np.asarray(largest[bucket])

    def _make_anew(self, is_lost: Booleans, between: Callable[[], None]) -> None:
        """Make these maxima (buckets, D) anew of the pairs that are left."""
        self._largest[is_lost] = 0
        buckets = np.flatnonzero(is_lost.any(axis=1)).tolist()
        for start in range(0, len(self._kind), _ROWS):
            between()
            slots = np.arange(len(self._kind))
            rows = slots[start : start + _ROWS]
            is_pair = self._is_taken[rows, None] & self._is_taken & (slots < rows[:, None])
            is_pair &= (self._kind[rows, None] == ENTRY) | (self._kind == ENTRY)
            later, earlier = np.nonzero(is_pair)
            pairs = self._chosen(later + start, earlier)
            pairs = pairs.of(np.argsort(pairs.bucket, kind="stable"))
            bounds = np.searchsorted(pairs.bucket, np.arange(_N_BUCKETS + 1)).tolist()
            for bucket in buckets:
                draws = np.flatnonzero(is_lost[bucket])
                turned = np.ascontiguousarray(self._turned[:, draws].T)
                some = pairs.of(slice(bounds[bucket], bounds[bucket + 1]))
                self._raise_some(bucket, draws, turned, some, sign=1)
                if bucket == _NEVER:
                    some = pairs.of(np.flatnonzero(pairs.is_two_sided))
                    self._raise_some(bucket, draws, turned, some, sign=-1)

    def _raise_some(self, bucket: int, draws: Slots, turned: Weights, pairs: _Chosen, *, sign: int) -> None:
        """Raise the maxima of a bucket in these draws, by `turned` (draws, slots)."""
        size = max(_CELLS // len(draws), 1)
        for first in range(0, len(pairs.worse), size):
            some = pairs.of(slice(first, first + size))
            rises = (turned[:, some.worse] - turned[:, some.better]) * some.inverse
            found = (rises if sign > 0 else -rises).max(axis=1)
            self._largest[bucket, draws] = np.maximum(self._largest[bucket, draws], found)


@dataclass(frozen=True, slots=True, eq=False)
class _Chosen:
    """Some pairs: which slot is worse if any is, 1 / √ΣD², the bucket; all (n,).

    Of a two-sided pair the opposite, that the better one is worse, can never be rejected and takes part.
    """

    worse: Slots
    better: Slots
    inverse: Weights
    bucket: NDArray[np.uint8]
    is_two_sided: Booleans

    def of(self, chosen: Slots | slice) -> _Chosen:
        """Those of them."""
        return _Chosen(
            worse=self.worse[chosen],
            better=self.better[chosen],
            inverse=self.inverse[chosen],
            bucket=self.bucket[chosen],
            is_two_sided=self.is_two_sided[chosen],
        )


def _exact(sums: Floats) -> Floats:
    """Sums (n, G) as multiples of a power of two, so that no sum of them, signs turned, is rounded.

    They lose nothing that the sum of all had not lost: the last of 52 binary digits of Σ|S|.
    """
    _, exponents = np.frexp(np.abs(sums).sum(axis=1, keepdims=True))
    return np.asarray(np.ldexp(np.rint(np.ldexp(sums, _DIGITS - exponents)), exponents - _DIGITS))


def _buckets(t: Weights) -> NDArray[np.uint8]:
    """The bucket of each t ≥ 0: it never falls while t rises."""
    steps = np.floor((t - np.float32(_FIRST)) * np.float32(_STEPS_PER_UNIT)) + 2
    return np.where(t > 0, np.clip(steps, 1, _N_BUCKETS - 1), _NEVER).astype(np.uint8)


def _critical(largest: Weights) -> float:
    return float(np.quantile(largest, CONFIDENCE, method="higher"))


def _rises(turned: Weights, pairs: _Chosen, chunk: slice, room: Weights) -> Weights:
    """How far the worse of some pairs rises above the better in every draw, in standard errors; in `room`."""
    n = chunk.stop - chunk.start
    rises, low = room[0, :n, : turned.shape[1]], room[1, :n, : turned.shape[1]]
    np.take(turned, pairs.worse[chunk], axis=0, out=rises, mode="clip")
    np.take(turned, pairs.better[chunk], axis=0, out=low, mode="clip")
    np.subtract(rises, low, out=rises)
    return np.multiply(rises, pairs.inverse[chunk, None], out=rises)


def _raise_to(largest: Weights, found: Weights) -> None:
    np.maximum(largest, found, out=largest)
