"""Columnar reading of a prediction file, without a Python object per key.

Keys of a few digits are compared with the manifest's as 64-bit words and overwritten with spaces; the JSON
list of numbers that remains goes to a fast parser. Other files become a dictionary. The result is that of the
strict reading (`evaluator.predictions.alignment`), or None where that might refuse.
"""

# Why reading by words is exact, for n sequences. It needs that (1) the text has n colons, (2) the bytes
# before each are another key of the manifest in its quotation marks, (3) each key but the first follows a
# comma and the same white space, the first `{` and white space, and (4) the text with keys blanked and the
# outer braces as brackets is a JSON list of n numbers. By (4) there are n - 1 commas, by (3) each is directly
# before a key; so every part between commas has one key, at its start, and one number.

from __future__ import annotations

import re
import struct
from functools import lru_cache
from itertools import repeat
from typing import Final, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from evaluator.metrics.scale import Floats, scale_ratio_to_ttc
from evaluator.predictions.alignment import Aligned, read_rates
from evaluator.predictions.documents import BYTE_ORDER_MARK, Document, Members, parse, read_document
from evaluator.predictions.values import allowed
from evaluator.problems import Findings, Rejected
from evaluator.truth.ground_truth import KeyKind, Manifest

Words = NDArray[np.uint64]
Rows = NDArray[np.intp]

_WHITE_SPACE: Final = b" \t\r\n"
_WORD_BYTES: Final = 8
_MAX_DIGITS: Final = 5
"""A longer key with its two quotation marks and its colon does not fit into a word."""
_SPACES: Final = np.frombuffer(b" " * _WORD_BYTES, dtype="<u8")[0]

_MAX_AROUND: Final = 64 * 1024
"""At most so much text may stand around the predictions of an envelope that is read by columns."""

_PREDICTIONS: Final = re.compile(rb'"predictions"[ \t\r\n]*:[ \t\r\n]*\{')
_FIRST_DIGIT: Final = re.compile(rb'\{[ \t\r\n]*"[0-9]{1,%d}"' % _MAX_DIGITS)
_PLACEHOLDER: Final = "predictions, read by columns"

_FLAT: Final = Document(Members(), "ttc", None, None, None, enveloped=False)
_OBJECT: Final = msgspec.json.Decoder(dict[str, float])
_LIST: Final = msgspec.json.Decoder(list[float])


def read_column(data: bytes, manifest: Manifest) -> Aligned | None:
    """Align a regular file's values, or return None."""
    parts = _split(data.removeprefix(BYTE_ORDER_MARK).strip(_WHITE_SPACE))
    if parts is None:
        return None
    members, document = parts
    column = _by_words(members, manifest) or _by_object(members, manifest)
    if column is None:
        return None
    values, keys = column
    if document.unit == "scale_ratio":
        if not allowed(values, unit="scale_ratio").all():
            return None
        values = scale_ratio_to_ttc(values, fps_hz=_rates(document, manifest))
    # Also NaN from a faulty rate.
    if not allowed(values, unit="ttc").all():
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
    if text[:1] != b"{" or text[-1:] != b"}":
        return None
    if text.find(b"{", 1) < 0:
        return text, _FLAT
    return _split_envelope(text)


def _split_envelope(text: bytes) -> tuple[bytes, Document] | None:
    match = _PREDICTIONS.search(text, 0, _MAX_AROUND)
    if match is None:
        return None
    start = match.end() - 1
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


class KeyWords(NamedTuple):
    """The keys of a manifest as bytes of a file, `"123":`, at the end of 64-bit words; all (n,)."""

    # `masks` select these bytes, `lengths` count them; `row_of_number` is the row of each anno_id.

    words: Words
    masks: Words
    lengths: Rows
    row_of_number: Rows


@lru_cache(maxsize=4)
def key_words(manifest: Manifest) -> KeyWords | None:
    """Make the words of a manifest's keys; None if a key has more than five digits."""
    if int(manifest.anno_id.max()) >= 10**_MAX_DIGITS:
        return None
    texts = np.char.add(np.char.add(b'"', manifest.anno_id.astype(f"S{_MAX_DIGITS}")), b'":')
    lengths = np.char.str_len(texts)
    shifts = (8 * (_WORD_BYTES - lengths)).astype(np.uint64)
    row_of_number = np.zeros(int(manifest.anno_id.max()) + 1, dtype=np.intp)
    row_of_number[manifest.anno_id] = np.arange(manifest.n_sequences)
    return KeyWords(texts.view("<u8") << shifts, np.uint64(2**64 - 1) << shifts, lengths, row_of_number)


def _by_words(text: bytes, manifest: Manifest) -> tuple[Floats, KeyKind] | None:
    keys, n = key_words(manifest), manifest.n_sequences
    if keys is None or not _FIRST_DIGIT.match(text):
        return None
    buffer = bytearray(_WORD_BYTES)
    buffer += text
    octets = np.frombuffer(buffer, dtype=np.uint8)
    colons = np.flatnonzero(octets == ord(":"))
    if len(colons) != n:
        return None
    # The eight bytes from each position of the buffer on, as one word.
    windows: Words = np.ndarray((len(buffer) - 7,), dtype="<u8", buffer=buffer, strides=(1,))
    words = windows[colons - 7]
    rows: Rows | slice = slice(None)
    if ((words ^ keys.words) & keys.masks).any():
        # The keys stand in another order than the manifest's: the only rows that they may be are these.
        rows = keys.row_of_number[np.minimum(_numbers_in(words), len(keys.row_of_number) - 1)]
        if ((words ^ keys.words[rows]) & keys.masks[rows]).any() or np.bincount(rows).max() > 1:
            return None
    opens = colons + 1 - keys.lengths[rows]
    if not _are_separated(buffer, octets, opens, first_colon=int(colons[0])):
        return None
    # Where values are so short that windows overlap, a window brings back the end of the key before it: its
    # colon is no JSON then, and the dictionary takes over.
    masks = keys.masks[rows]
    windows[colons - 7] = (words & ~masks) | (masks & _SPACES)
    buffer[colons[0]], buffer[-1] = b"[]"
    try:
        # Packing is the fastest way into an array; it also counts.
        values = np.frombuffer(struct.pack(f"{n}d", *_LIST.decode(memoryview(buffer)[int(colons[0]) :])))
    except (msgspec.MsgspecError, ValueError, RecursionError, struct.error):
        return None
    aligned = np.empty_like(values)
    aligned[rows] = values
    return aligned, "anno_id"


def _are_separated(buffer: bytearray, octets: NDArray[np.uint8], opens: Rows, *, first_colon: int) -> bool:
    if buffer[_WORD_BYTES : opens[0]].strip(_WHITE_SPACE) != b"{":
        return False
    if len(opens) == 1:
        return True
    number = buffer[first_colon : opens[1]].rstrip(_WHITE_SPACE)
    between = buffer[first_colon + len(number) - 1 : opens[1]]
    if not between.startswith(b",") or len(between) > 64:
        return False
    return all((octets[opens[1:] - back] == octet).all() for back, octet in enumerate(reversed(between), 1))


def _numbers_in(words: Words) -> Words:
    # The digits before the last two bytes; words without digits give any number.
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


def _by_object(text: bytes, manifest: Manifest) -> tuple[Floats, KeyKind] | None:
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
    # A natural key has slashes, an anno_id has none.
    is_natural = "/" in next(iter(members))
    kind: KeyKind = "natural_key" if is_natural else "anno_id"
    if tuple(members) == manifest.keys_of(kind):
        return values, kind
    row_of = manifest.row_of_natural_key if is_natural else manifest.row_of_id
    rows = np.fromiter(map(row_of.get, members, repeat(-1)), dtype=np.intp, count=n)
    if rows.min() < 0:
        return None
    aligned = np.empty_like(values)
    aligned[rows] = values
    return aligned, kind
