"""Rank ranges: all pairs of a column compared at once, published results among them.

A quoted row was printed in a paper and has no recordings. Its value v is known as exactly as it was printed:
14.8 may have been anything from 14.75 to 14.85. In recording g an entry of exactly that value would have the
sum v n_g, so a quoted row takes part as such an entry: as one of its upper end where an entry is asked to be
worse than it, of its lower end where one is asked to be better. What is found then holds whatever the value
was before it was rounded. Two quoted rows are never compared.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, KeysView, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from evaluator.metrics.scale import Floats
from evaluator.scoring.pairs import ENTRY, LOWER_END, UPPER_END, Integers, Pairs
from evaluator.scoring.uncertainty import Booleans

N_RANK_FLIPS: Final = 2_000
"""All pairs are compared at once, 19,900 of 200 entries; their critical value is read from so many draws."""

# Of a board that is kept: room for so many entries more than it has.
_ROOM: Final = 32


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
    first = _n_ends(quoted)
    low = np.zeros(published.shape, dtype=np.int64)
    high = low.copy()
    signs = _signs(rng, n_recordings=sums.shape[1])
    for column in np.flatnonzero(usable).tolist():
        present = np.flatnonzero(np.isfinite(published[:, column]))
        if not present.size:
            continue
        pairs = _column(signs, quoted, column, n_slots=first + len(published), between=between)
        pairs.add(
            first + present,
            sums=sums[present, :, column],
            values=published[present, column],
            kind=ENTRY,
            between=between,
        )
        found = _ranges(pairs, between=between)
        low[present, column], high[present, column] = (ends[first + present] for ends in found)
    return RankRanges(low, high)


class KeptRanges:
    """The rank ranges of a board whose pairs are kept: an entry more or less costs its own pairs alone.

    Whatever came and went before, they are those of `rank_ranges` of the present entries, bit for bit. Rows
    from papers stay as they are. After an exception it is of no use any more.
    """

    def __init__(
        self,
        *,
        n_recordings: int,
        usable: Booleans,
        rng: np.random.Generator,
        quoted: Quoted | None = None,
        n_entries: int = 0,
    ) -> None:
        self._n_columns, self._first = len(usable), _n_ends(quoted)
        self._slot_of: dict[Hashable, int] = {}
        n_slots = self._first + n_entries + _ROOM
        self._free = list(range(n_slots - 1, self._first - 1, -1))
        signs = _signs(rng, n_recordings=n_recordings)
        self._columns = {
            column: _column(signs, quoted, column, n_slots=n_slots)
            for column in np.flatnonzero(usable).tolist()
        }
        self._n_slots = n_slots

    @property
    def keys(self) -> KeysView[Hashable]:
        """Of the entries that are there."""
        return self._slot_of.keys()

    @property
    def nbytes(self) -> int:
        """What it takes of memory."""
        return sum(pairs.nbytes for pairs in self._columns.values())

    @staticmethod
    def nbytes_of(n_entries: int, *, n_recordings: int, n_columns: int) -> int:
        """What so many entries take, about."""
        return n_columns * Pairs.nbytes_of(n_entries + _ROOM, n_recordings=n_recordings, n_draws=N_RANK_FLIPS)

    def remove(self, keys: Collection[Hashable], *, between: Callable[[], None] = lambda: None) -> None:
        """Take entries off the board."""
        slots = [self._slot_of.pop(key) for key in keys]
        for pairs in self._columns.values():
            pairs.remove(np.array(slots, dtype=np.intp), between=between)
        self._free += slots

    def add(
        self,
        keys: Sequence[Hashable],
        *,
        sums: Floats,
        published: Floats,
        between: Callable[[], None] = lambda: None,
    ) -> None:
        """Put entries on the board, by their `sums` (n, G, columns) and `published` values (n, columns)."""
        missing = len(keys) - len(self._free)
        if missing > 0:
            n_slots = self._n_slots + missing + _ROOM
            self._free = [*range(n_slots - 1, self._n_slots - 1, -1), *self._free]
            self._n_slots = n_slots
        slots = np.array([self._free.pop() for _ in keys], dtype=np.intp)
        self._slot_of |= zip(keys, slots.tolist(), strict=True)
        for column, pairs in self._columns.items():
            pairs.reserve(self._n_slots)
            present = np.flatnonzero(np.isfinite(published[:, column]))
            pairs.add(
                slots[present],
                sums=sums[present, :, column],
                values=published[present, column],
                kind=ENTRY,
                between=between,
            )

    def ranges(self, keys: Sequence[Hashable], *, between: Callable[[], None] = lambda: None) -> RankRanges:
        """The ranges of these entries among all that are there."""
        slots = np.array([self._slot_of[key] for key in keys], dtype=np.intp)
        low, high = np.zeros((2, len(keys), self._n_columns), dtype=np.int64)
        for column, pairs in self._columns.items():
            low[:, column], high[:, column] = (ends[slots] for ends in _ranges(pairs, between=between))
        return RankRanges(low, high)


def _signs(rng: np.random.Generator, *, n_recordings: int) -> Floats:
    """The draws by which recordings are turned, −1 or 1: (G, draws)."""
    drawn = rng.integers(0, 2, size=(N_RANK_FLIPS, n_recordings), dtype=np.int8)
    return np.ascontiguousarray(drawn.T, dtype=np.float64) * 2 - 1


def _n_ends(quoted: Quoted | None) -> int:
    return 0 if quoted is None else 2 * len(quoted.values)


def _column(
    signs: Floats,
    quoted: Quoted | None,
    column: int,
    *,
    n_slots: int,
    between: Callable[[], None] = lambda: None,
) -> Pairs:
    """A column with both ends of its quoted rows in the first slots."""
    pairs = Pairs(signs, n_slots=n_slots)
    if quoted is None:
        return pairs
    values, half = quoted.values[:, column], quoted.half_widths[:, column]
    present = np.flatnonzero(np.isfinite(values))
    for first, kind in ((0, UPPER_END), (len(values), LOWER_END)):
        ends = (values + kind * half)[present]
        sums = ends[:, None] * quoted.counts[:, column]
        pairs.add(first + present, sums=sums, values=ends, kind=kind, between=between)
    return pairs


def _ranges(pairs: Pairs, *, between: Callable[[], None]) -> tuple[Integers, Integers]:
    """Of every slot both ends of its range; 0 where there is no entry."""
    n_better, n_worse = pairs.told_apart(pairs.step_down(between=between))
    return np.where(pairs.is_entry, 1 + n_better, 0), np.where(pairs.is_entry, pairs.n_rows - n_worse, 0)
