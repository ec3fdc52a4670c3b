"""The columnar reading of a prediction file: no Python object per key, no dictionary.

Files that machines write are monotonous: keys of a few digits, one separator, one number each. For these the
keys are compared with the manifest's as 64-bit words, then overwritten with spaces, so that what remains of
the object is a JSON list of numbers for a fast parser, which reads some thousands of them at a time. Natural
keys in the manifest's order, and the numbers behind them, are copied into rows of words instead, some
thousands at a time, and compared with the manifest's row by row. Files with other keys, or another layout,
are parsed into a dictionary.

All ways accept only what the strict reading (`evaluator.predictions.alignment`) accepts, with the same
result, and answer None for everything else: finding words for a fault is the strict reading's business.

Why the first way is exact. Let n be the number of sequences. It is taken only if (1) the text has n colons,
(2) what stands before each is, byte for byte, the key of another sequence of the manifest with its quotation
marks, (3) each key but the first is preceded by a comma and the same white space, the first by `{` and white
space, and (4) the text with all these keys blanked, and the outer braces turned into brackets, is a JSON list
of n numbers: it is cut at commas that precede a key, and each piece is a list of as many numbers as it had
keys. By (4) there are n - 1 commas, by (3) each stands directly before a key; so every part between commas
holds one key, at its front, and one number.

The second way is exact for the same reasons: a key's row is what stands from an odd quotation mark to one
byte behind the next one, and is, byte for byte, the next key of the manifest; a number's row is all that
stands from there to the next odd quotation mark, and spaces.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from typing import Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from evaluator.metrics.scale import Floats, scale_ratio_to_ttc
from evaluator.predictions.alignment import Aligned, KeyKind, read_rates
from evaluator.predictions.documents import BYTE_ORDER_MARK, Document, Members, parse, read_document
from evaluator.problems import Findings, Rejected
from evaluator.truth.packed_keys import (
    MAX_CELL_BYTES,
    MAX_DIGITS,
    WORD_BYTES,
    KeyWords,
    Rows,
    Words,
    cells_of,
)
from evaluator.truth.truth import Manifest

Octets = NDArray[np.uint8]

_WHITE_SPACE: Final = b" \t\r\n"
_PAD: Final = b" " * WORD_BYTES
_CELL_PAD: Final = b" " * MAX_CELL_BYTES
_SPACE, _QUOTE, _COLON, _BRACKETS = ord(" "), ord('"'), ord(":"), b"[]"

_MAX_AROUND: Final = 64 * 1024
"""At most so much text may stand around the predictions of an envelope that is read by columns."""

_PREDICTIONS: Final = re.compile(rb'"predictions"[ \t\r\n]*:[ \t\r\n]*\{')
_FIRST_DIGIT: Final = re.compile(rb'\{[ \t\r\n]*"[0-9]{1,%d}"' % MAX_DIGITS)
_BLOCK: Final = 1 << 19
"""So many bytes of a file with natural keys are read at once: they stay in the processor's cache."""

_STRETCH: Final = 1 << 17
"""So many bytes of other files are searched for colons at once, ..."""
_KEYS: Final = 1 << 14
"""... so many keys are compared, ..."""
_NUMBERS: Final = 1 << 11
"""... and so many numbers exist as Python objects."""

_MAX_BETWEEN: Final = 64
"""At most so many bytes may a comma and the white space behind it have."""

_PLACEHOLDER: Final = "predictions, read by columns"

_FLAT: Final = Document(Members(), "ttc", None, None, None, enveloped=False)
_OBJECT: Final = msgspec.json.Decoder(dict[str, float])
_LIST: Final = msgspec.json.Decoder(list[float])


def read_column(data: bytes, manifest: Manifest) -> Aligned | None:
    """The aligned values of a file without surprises, or None for any other."""
    parts = _split(data.removeprefix(BYTE_ORDER_MARK).strip(_WHITE_SPACE))
    if parts is None:
        return None
    members, document = parts
    column = _by_words(members, manifest) or _by_spelling(members, manifest) or _by_object(members, manifest)
    if column is None:
        return None
    values, keys = column
    if document.unit == "scale_ratio":
        if not values.min() > 0.0:
            return None
        values = scale_ratio_to_ttc(values, fps_hz=_rates(document, manifest))
    # NaN (also from a faulty rate) and 0 are faults; |x| > 0 holds for neither.
    if not np.abs(values).min() > 0.0:
        return None
    return Aligned(document, values, keys)


def _rates(document: Document, manifest: Manifest) -> Floats:
    findings = Findings()
    rates = read_rates(document, manifest, findings)
    try:
        findings.raise_if_any()
    except Rejected:
        return np.array(np.nan)
    return rates


def _split(text: bytes) -> tuple[bytes, Document] | None:
    """The object of predictions, which has no further object inside, and the document around it."""
    if text[:1] != b"{" or text[-1:] != b"}":
        return None
    if text.find(b"{", 1) < 0:
        return text, _FLAT
    return _split_envelope(text)


def _split_envelope(text: bytes) -> tuple[bytes, Document] | None:
    found = _PREDICTIONS.search(text, 0, _MAX_AROUND)
    if found is None:
        return None
    start = found.end() - 1
    stop = text.find(b"}", start) + 1
    around = text[:start], text[stop:]
    if sum(map(len, around)) > _MAX_AROUND or any(_PLACEHOLDER.encode() in part for part in around):
        return None
    # With the placeholder in its place, the rest is read strictly. If the placeholder comes back as the
    # predictions, what was found is the envelope's own member, and no doubled or nested one.
    try:
        document = read_document(parse(b'%b{"%b":0}%b' % (around[0], _PLACEHOLDER.encode(), around[1])))
    except Rejected:
        return None
    if not document.enveloped or document.predictions != [(_PLACEHOLDER, 0)]:
        return None
    return text[start:stop], document


def _by_words(text: bytes, manifest: Manifest) -> tuple[Floats, KeyKind] | None:
    """Read keys of up to six digits as words; the module's docstring says why this is exact."""
    keys, n = manifest.key_words, manifest.n_sequences
    if keys is None or not _FIRST_DIGIT.match(text):
        return None
    buffer = bytearray(_PAD)
    buffer += text
    colons = _colons(buffer, n)
    if colons is None:
        return None
    rows = _blank_keys(buffer, keys, colons)
    values = None if rows is None else _numbers_by_part(buffer, colons)
    if values is None:
        return None
    if isinstance(rows, slice):
        return values, "anno_id"
    aligned = np.empty_like(values)
    aligned[rows] = values
    return aligned, "anno_id"


def _colons(buffer: bytearray, n: int) -> Rows | None:
    """The places of the colons, or None unless there are n."""
    octets = np.frombuffer(buffer, dtype=np.uint8)
    colons, n_found = np.empty(n, dtype=np.intp), 0
    for start in range(0, len(octets), _STRETCH):
        part = np.flatnonzero(octets[start : start + _STRETCH] == _COLON)
        stop = n_found + len(part)
        if stop > n:
            return None
        np.add(part, start, out=colons[n_found:stop])
        n_found = stop
    return colons if n_found == n else None


def _blank_keys(buffer: bytearray, keys: KeyWords, colons: Rows) -> Rows | slice | None:
    """Turn the keys before these colons into spaces; the row of each, or None if any is odd."""
    octets = np.frombuffer(buffer, dtype=np.uint8)
    # The eight bytes from each position of the buffer on, as one word.
    windows: Words = np.ndarray((len(buffer) - 7,), dtype="<u8", buffer=buffer, strides=(1,))
    n, rows, between = len(colons), None, None
    for part in _parts(n, _KEYS):
        starts = colons[part] - 7
        words = windows[starts]
        blank = keys.blank(words, part) if rows is None else None
        if blank is None:
            # From here on the keys stand in another order than the manifest's.
            rows = np.arange(n) if rows is None else rows
            rows[part] = keys.likely_rows(words)
            blank = keys.blank(words, rows[part])
        if blank is None:
            return None
        opens = starts + 5
        opens -= blank.n_digits
        following = opens if part.start else opens[1:]
        if between is None and len(following):
            between = _between(bytes(buffer[colons[0] : following[0]]))
        if not (octets[opens] == _QUOTE).all() or not _follow(octets, following, between):
            return None
        if part.start == 0 and buffer[len(_PAD) : opens[0]].strip(_WHITE_SPACE) != b"{":
            return None
        if not keys.fits:
            octets[opens] = _SPACE
        # Where values are so short that windows overlap, a window brings back the end of the key before it:
        # its colon is no JSON then, and the dictionary takes over.
        windows[starts] = blank.words
    if rows is None:
        return slice(None)
    return rows if int(np.bincount(rows, minlength=n).max()) == 1 else None


def _parts(n: int, size: int) -> Iterator[slice]:
    """All of n keys, `size` at once: what is computed of them stays small."""
    return (slice(first, min(first + size, n)) for first in range(0, n, size))


def _numbers_by_part(buffer: bytearray, colons: Rows) -> Floats | None:
    """The numbers behind keys that are blank and ended at `colons`; a comma precedes each but the first."""
    n = len(colons)
    values, text = np.empty(n), memoryview(buffer)
    for part in _parts(n, _NUMBERS):
        first, last = int(colons[part.start]), len(buffer) - 1
        if part.stop < n:
            last = buffer.rindex(b",", first, int(colons[part.stop]))
        buffer[first], buffer[last] = _BRACKETS
        numbers = _numbers(text[first : last + 1], part.stop - part.start)
        if numbers is None:
            return None
        values[part] = numbers
    return values


def _numbers(text: bytes | memoryview, n: int) -> Floats | None:
    """The float64 values of a JSON list of n numbers, or None for anything else."""
    try:
        # Packing is the fastest way into an array; it also counts.
        return np.frombuffer(struct.pack(f"{n}d", *_LIST.decode(text)))
    except (msgspec.MsgspecError, ValueError, RecursionError, struct.error):
        return None


def _by_spelling(text: bytes, manifest: Manifest) -> tuple[Floats, KeyKind] | None:
    """Read natural keys in the manifest's order, block by block; see the module's docstring."""
    keys, n = manifest.natural_key_text, manifest.n_sequences
    start, row = text.find(b'"'), 0
    if keys is None or text[:start].strip(_WHITE_SPACE) != b"{":
        return None
    values = np.empty(n)
    between: bytes | None = None
    while start < len(text):
        size = len(text) - start
        is_last = size <= _BLOCK + MAX_CELL_BYTES
        if is_last:
            octets = np.frombuffer(text[start:] + _CELL_PAD, dtype=np.uint8)
        else:
            size = _BLOCK
            octets = np.frombuffer(text, dtype=np.uint8, count=size + MAX_CELL_BYTES, offset=start)
        quotes = np.flatnonzero(octets[:size] == _QUOTE)
        # All but the last block end before the key that the next one begins with.
        n_members = (len(quotes) - (0 if is_last else 1)) // 2
        if n_members < 1 or row + n_members > n:
            return None
        opens, closes = quotes[: 2 * n_members : 2], quotes[1 : 2 * n_members : 2]
        following = quotes[2 : 2 * n_members + (not is_last) : 2]
        if between is None and len(following):
            between = _between(octets[: following[0]].tobytes())
        if not _follow(octets, following, between) or not keys.is_at(octets, opens, closes, row=row):
            return None
        ends = np.append(following, size - 1) if is_last else following
        part = _numbers_between(octets, closes + 2, ends, is_last=is_last)
        if part is None:
            return None
        values[row : row + n_members] = part
        start, row = start + (size if is_last else int(ends[-1])), row + n_members
    return (values, "natural_key") if row == n else None


def _between(first: bytes) -> bytes | None:
    """The comma and the white space at the end of the first member, or None for anything else."""
    number = first.rstrip(_WHITE_SPACE)
    between = first[len(number) - 1 :]
    return between if number[-1:] == b"," and len(between) <= _MAX_BETWEEN else None


def _follow(block: Octets, opens: Rows, between: bytes | None) -> bool:
    """Whether each of these marks follows this comma and white space."""
    if not len(opens):
        return True
    if between is None:
        return False
    before = enumerate(reversed(between), 1)
    return all(bool((block[opens - back] == octet).all()) for back, octet in before)


def _numbers_between(octets: Octets, starts: Rows, ends: Rows, *, is_last: bool) -> Floats | None:
    """The numbers of members, from behind their colons on; a comma follows each but the last of all."""
    cells = cells_of(octets, starts, ends - starts, filling=_SPACE)
    if cells is None:
        return None
    last: bytes = cells[-1].tobytes()
    if not is_last:
        last = last.rstrip(_WHITE_SPACE).removesuffix(b",")
    return _numbers(b"".join((b"[", cells[:-1].data, last, b"]")), len(starts))


def _by_object(text: bytes, manifest: Manifest) -> tuple[Floats, KeyKind] | None:
    """Read any keys through a dictionary."""
    n = manifest.n_sequences
    # Keys of the manifest hold no comma. So if every key is one of them, the commas count the members, and a
    # doubled key, of which the dictionary keeps the last, shows as one comma too many.
    if text.count(b",") != n - 1:
        return None
    try:
        members = _OBJECT.decode(text)
    except (msgspec.MsgspecError, ValueError, RecursionError):
        # Invalid UTF-8 in a text is a UnicodeDecodeError, which is a ValueError.
        return None
    if len(members) != n:
        return None
    values = np.fromiter(members.values(), dtype=np.float64, count=n)
    kinds: tuple[tuple[KeyKind, tuple[str, ...], dict[str, int]], ...] = (
        ("anno_id", manifest.anno_id_keys, manifest.row_of_id),
        ("natural_key", manifest.natural_keys, manifest.row_of_natural_key),
    )
    for kind, in_order, row_of in kinds:
        if tuple(members) == in_order:
            return values, kind
        if members.keys() == row_of.keys():
            aligned = np.empty_like(values)
            aligned[np.fromiter(map(row_of.__getitem__, members), dtype=np.intp, count=n)] = values
            return aligned, kind
    return None
