"""Columnar reading of a prediction file: a dictionary of numbers, without a check of each member in Python.

The result is that of the strict reading (`evaluator.predictions.alignment`), or None where that might refuse.
"""

from __future__ import annotations

import re
from itertools import repeat
from typing import Final

import msgspec
import numpy as np

from evaluator.metrics.scale import Floats, scale_ratio_to_ttc
from evaluator.predictions.alignment import Aligned, read_rates
from evaluator.predictions.documents import BYTE_ORDER_MARK, Document, Members, parse, read_document
from evaluator.predictions.values import allowed
from evaluator.problems import Findings, Rejected
from evaluator.truth.ground_truth import KeyKind, Manifest

_WHITE_SPACE: Final = b" \t\r\n"

_MAX_AROUND: Final = 64 * 1024
"""At most so much text may stand around the predictions of an envelope that is read by columns."""

_PREDICTIONS: Final = re.compile(rb'"predictions"[ \t\r\n]*:[ \t\r\n]*\{')
_PLACEHOLDER: Final = "predictions, read by columns"

_FLAT: Final = Document(Members(), "ttc", None, None, None, enveloped=False)
_OBJECT: Final = msgspec.json.Decoder(dict[str, float])


def read_column(data: bytes, manifest: Manifest) -> Aligned | None:
    """Align a regular file's values, or return None."""
    parts = _split(data.removeprefix(BYTE_ORDER_MARK).strip(_WHITE_SPACE))
    if parts is None:
        return None
    members, document = parts
    column = _aligned(members, manifest)
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


def _aligned(text: bytes, manifest: Manifest) -> tuple[Floats, KeyKind] | None:
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
