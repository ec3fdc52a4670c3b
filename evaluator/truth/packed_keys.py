"""The keys of a manifest as they stand in a prediction file: as 64-bit words, or as rows of words."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.uint64]
Rows = NDArray[np.intp]
Lengths = NDArray[np.intp] | NDArray[np.uint8]

WORD_BYTES: Final = 8
MAX_DIGITS: Final = 6
MAX_CELL_BYTES: Final = 128
_BATCH: Final = 1 << 11
_CELL_PAD: Final = b" " * MAX_CELL_BYTES
_EVERY_BYTE: Final = 2**64 // 255

_FILLING: Final = np.array(
    [
        2**64 - 2 ** (8 * min(max(n_bytes, 0), WORD_BYTES))
        for n_bytes in range(-MAX_CELL_BYTES, MAX_CELL_BYTES + 1)
    ],
    dtype=np.uint64,
)
"""By the number of bytes up to the end of a piece, from -128 on: selects the bytes of a word behind it."""


def _mask(n_digits: int) -> int:
    n_bytes = min(n_digits + 3, WORD_BYTES)
    return (2**64 - 1) ^ ((1 << 8 * (WORD_BYTES - n_bytes)) - 1)


_MASKS: Final = np.array([0, *map(_mask, range(1, MAX_DIGITS + 1))], dtype=np.uint64)
"""By number of digits: selects the bytes of a word that belong to the key, the last ones."""

_SPACES: Final = np.frombuffer(b" " * WORD_BYTES, dtype="<u8")[0]


@dataclass(frozen=True, slots=True, eq=False)
class BlankKeys:
    """Words of a file without their keys, (m,), and how many digits each key had, (m,)."""

    words: Words
    n_digits: NDArray[np.uint8]


class KeyWords:
    """Every key with its punctuation, `"123":`, as the last bytes of a little-endian word, zeros before them.

    Keys have up to six digits. One of six leaves no room for its opening quotation mark; `fits` tells whether
    all marks are in their words.
    """

    def __init__(self, anno_id: NDArray[np.int64]) -> None:
        self._anno_id = anno_id
        n_digits = np.searchsorted(10 ** np.arange(1, MAX_DIGITS), anno_id, side="right") + 1
        self._words: Words = _spell(anno_id, n_digits)
        self._n_digits = n_digits.astype(np.uint8)
        self.fits = int(self._n_digits.max()) < MAX_DIGITS

    @classmethod
    def of(cls, anno_id: NDArray[np.int64]) -> KeyWords | None:
        """The words of these ids, or None when one has more than six digits."""
        return cls(anno_id) if int(anno_id.max()) < 10**MAX_DIGITS else None

    def blank(self, words: Words, rows: Rows | slice) -> BlankKeys | None:
        """The words, (m,), with spaces in place of the keys of these rows; None unless they end with them.

        A key of six digits leaves its opening quotation mark to the caller.
        """
        n_digits = self._n_digits[rows]
        masks = _MASKS.take(n_digits)
        rest = words ^ self._words[rows]
        if (rest & masks).any():
            return None
        masks &= _SPACES
        rest |= masks
        return BlankKeys(rest, n_digits)

    def likely_rows(self, words: Words) -> Rows:
        """The only rows whose keys the words, (m,), may end with."""
        numbers = _numbers(words)
        return self._row_of_number[np.minimum(numbers, len(self._row_of_number) - 1)]

    @cached_property
    def _row_of_number(self) -> Rows:
        rows = np.zeros(int(self._anno_id.max()) + 1, dtype=np.intp)
        rows[self._anno_id] = np.arange(len(self._anno_id))
        return rows


@dataclass(frozen=True, slots=True, eq=False)
class KeyText:
    """Keys of up to 125 bytes with their punctuation, `"a/b":`, each at the start of a row of words.

    `cells` (n, words) are those rows, `lengths` (n,) the bytes of each that are not filling.
    """

    cells: Words
    lengths: NDArray[np.uint8]

    @classmethod
    def of(cls, keys: Iterable[str], *, n: int) -> KeyText | None:
        """The text of these n keys, or None when one is too long, or JSON would write it in another way."""
        every = iter(keys)
        cells, lengths = np.zeros((n, 1), dtype="<u8"), np.empty(n, dtype=np.uint8)
        # Batch by batch, so that a million keys never exist all at once as texts.
        for row in range(0, n, _BATCH):
            found = _cells_of_keys(list(itertools.islice(every, _BATCH)))
            if found is None:
                return None
            part, rows = found[0], slice(row, row + _BATCH)
            n_more = part.shape[1] - cells.shape[1]
            if n_more > 0:
                cells = np.pad(cells, ((0, 0), (0, n_more)))
            cells[rows, : part.shape[1]], lengths[rows] = part, found[1]
        return cls(cells, lengths)

    def is_at(self, octets: NDArray[np.uint8], opens: Rows, closes: Rows, *, row: int) -> bool:
        """Whether the keys from `row` on stand between these quotation marks, (m,), each with its colon."""
        rows = slice(row, row + len(opens))
        lengths = self.lengths[rows]
        n_bytes = closes - opens
        n_bytes += 2
        if not np.array_equal(n_bytes, lengths):
            return False
        found = cells_of(octets, opens, lengths, filling=0, n_words=self.cells.shape[1])
        return found is not None and np.array_equal(found, self.cells[rows])


def _cells_of_keys(keys: Sequence[str]) -> tuple[Words, Rows] | None:
    try:
        text = "".join([f'"{key}":' for key in keys]).encode()
    except UnicodeEncodeError:
        return None
    octets = np.frombuffer(text + _CELL_PAD, dtype=np.uint8)
    quotes = np.flatnonzero(octets == ord('"'))
    if len(quotes) != 2 * len(keys) or b"\\" in text or int(octets.min()) < ord(" "):
        return None
    lengths = quotes[1::2] + 2 - quotes[::2]
    cells = cells_of(octets, quotes[::2], lengths, filling=0)
    return None if cells is None else (cells, lengths)


def cells_of(
    octets: NDArray[np.uint8], starts: Rows, lengths: Lengths, *, filling: int, n_words: int | None = None
) -> Words | None:
    """Copies of the pieces of a text as rows of words, (m, n_words), filled up with the octet `filling`.

    The text must go on for `MAX_CELL_BYTES` behind each start. None if a piece is longer than these. Without
    `n_words` the longest piece says how many words there are.
    """
    longest = int(lengths.max())
    if longest > MAX_CELL_BYTES:
        return None
    n_bytes = WORD_BYTES * (n_words or -(-longest // WORD_BYTES))
    # One copy of fixed length for each piece, which is much faster than to select bytes.
    windows = np.ndarray((len(octets) - n_bytes + 1,), dtype=f"V{n_bytes}", buffer=octets, strides=(1,))
    cells: Words = windows[starts].view("<u8").reshape(len(starts), -1)
    kept = np.uint64((0xFF ^ filling) * _EVERY_BYTE)
    # Words in which even the shortest piece has no filling stay as they are.
    for at in range(int(lengths.min()) // WORD_BYTES, n_bytes // WORD_BYTES):
        # Word by word, since to take a row for each piece takes longer.
        masks = _FILLING[MAX_CELL_BYTES - WORD_BYTES * at :].take(lengths)
        column = cells[:, at]
        column |= masks
        masks &= kept
        column ^= masks
    return cells


def _spell(anno_id: NDArray[np.int64], n_digits: Rows) -> Words:
    octets = np.zeros((len(anno_id), WORD_BYTES), dtype=np.uint8)
    octets[:, -2:] = tuple(b'":')
    rest = anno_id
    for place in range(MAX_DIGITS):
        at = MAX_DIGITS - 1 - place
        octets[:, at] = np.where(place < n_digits, rest % 10 + ord("0"), 0)
        rest = rest // 10
    inside = n_digits < MAX_DIGITS
    octets[np.flatnonzero(inside), MAX_DIGITS - 1 - n_digits[inside]] = ord('"')
    return octets.view("<u8").ravel()


def _numbers(words: Words) -> Words:
    """The decimal numbers before the last two bytes of words; words without a number give any number."""
    other = (words ^ np.uint64(0x303030303030)) & np.uint64(0xF0F0F0F0F0F0)
    # The last byte that is no digit sets all bits before it.
    for n_bits in (1, 2, 4, 8, 16, 32):
        other |= other >> np.uint64(n_bits)
    x = (words & ~other & np.uint64(0x0F0F0F0F0F0F)) << np.uint64(16)
    # All digits at once: pairs, then pairs of two digits, then of four. Each product puts high · base + low
    # into the upper half.
    x = (x * np.uint64(10 * 2**8 + 1)) >> np.uint64(8)
    x = ((x & np.uint64(0x00FF00FF00FF00FF)) * np.uint64(100 * 2**16 + 1)) >> np.uint64(16)
    return ((x & np.uint64(0x0000FFFF0000FFFF)) * np.uint64(10_000 * 2**32 + 1)) >> np.uint64(32)
