"""Prediction files: bytes to values aligned with a manifest (docs/file-format.md)."""

# For any bytes, `read_sent` either raises `Rejected` or gives every sequence one value, neither 0 nor NaN.

from __future__ import annotations

import csv
import hashlib
import io
import json
import re
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from evaluator.arguments import Source, data_of, require
from evaluator.arrays import as_floats, in_row_order
from evaluator.counting import counted
from evaluator.metrics.scale import Floats, scale_ratio_to_ttc
from evaluator.predictions import headers, recognition
from evaluator.predictions.alignment import read_slowly
from evaluator.predictions.columns import read_column
from evaluator.predictions.documents import Unit, too_large
from evaluator.predictions.parquet import as_sent
from evaluator.predictions.writing import rate_of, require_values
from evaluator.problems import pointer, reject
from evaluator.truth.ground_truth import KeyKind, Manifest


@dataclass(frozen=True, slots=True, eq=False)
class Predictions:
    """One value per sequence of the manifest.

    `ttc_s` is a read-only array `(n,)` in the manifest's order: seconds from the target frame, not truncated.
    `digest` is "sha256:" and the hex SHA-256 of the file's bytes. `names` are the file's keys by row, if it
    was written for another manifest.
    """

    manifest: Manifest
    ttc_s: Floats
    digest: str
    unit: Unit = "ttc"
    meta: Mapping[str, object] | None = None
    keys: KeyKind = "anno_id"
    enveloped: bool = False
    names: tuple[str, ...] | None = None

    def __repr__(self) -> str:
        ends = f"{self.ttc_s.min():.4g} to {self.ttc_s.max():.4g} s"
        return f"Predictions({counted(len(self.ttc_s), 'sequence')}, {ends}, {self.digest[:19]}…)"

    @classmethod
    def from_arrays(
        cls,
        *,
        manifest: Manifest,
        ttc_s: ArrayLike | None = None,
        scale_ratio: ArrayLike | None = None,
        fps_hz: float | None = None,
        frame_gap: int | None = None,
        digest: str | None = None,
    ) -> Predictions:
        """Make predictions from arrays `(n,)` in the manifest's order.

        Give `ttc_s` (seconds), or `scale_ratio` with `fps_hz` or `frame_gap`. The default `digest` is that of
        the seconds as little-endian float64. Raises `ValueError` for a wrong shape, order or combination of
        arguments, `TypeError` for a dict, `Rejected` for scale ratios that are not positive; `evaluate`
        checks the values further.
        """
        require(manifest, Manifest, name="manifest")
        name, given = ("scale_ratio", scale_ratio) if ttc_s is None else ("ttc_s", ttc_s)
        if given is None or (ttc_s is not None and scale_ratio is not None):
            raise ValueError("Give either ttc_s or scale_ratio.")
        values = in_row_order(given, name=name, anno_id=manifest.anno_id)
        if values.shape != (manifest.n_sequences,):
            raise ValueError(f"{name} has the shape {values.shape}; expected ({manifest.n_sequences},).")
        unit: Unit = "ttc"
        rate_hz = rate_of(is_ratio=ttc_s is None, fps_hz=fps_hz, frame_gap=frame_gap)
        if rate_hz is not None:
            require_values(values, manifest.anno_id_keys, is_ratio=True)
            values, unit = scale_ratio_to_ttc(values, fps_hz=rate_hz), "scale_ratio"
        values.setflags(write=False)
        content_digest = digest if digest is not None else sha256_digest(values.astype("<f8").tobytes())
        return cls(manifest=manifest, ttc_s=values, digest=content_digest, unit=unit)

    @classmethod
    def from_dict(cls, seconds: Mapping[Any, Any], *, manifest: Manifest) -> Predictions:
        """Predictions from seconds by anno_id or natural key, in any order, as a file has them.

        Anno_ids may be integers, values tensors of one element. Raises `Rejected` in the words that a file
        would get.
        """
        require(manifest, Manifest, name="manifest")
        pairs = ((str(key), as_floats(value).item()) for key, value in seconds.items())
        members = ",".join(f"{json.dumps(key)}:{json.dumps(value)}" for key, value in pairs)
        return read_sent(f"{{{members}}}".encode(), manifest=manifest)

    @classmethod
    def merge(cls, parts: Iterable[Predictions], *, manifest: Manifest) -> Predictions:
        """The predictions of parts of `manifest`, such as batches or the shares of several processes, in one.

        Of a sequence in two parts the first counts: samplers repeat some to fill a batch. Raises `Rejected`
        for sequences that no part has.
        """
        seconds: dict[str, float] = {}
        for part in parts:
            values = zip(part.manifest.natural_keys, part.ttc_s.tolist(), strict=True)
            seconds = dict(values) | seconds
        return cls.from_dict(seconds, manifest=manifest)

    def subset(self, rows: ArrayLike) -> Predictions:
        """Return the predictions of some sequences; raises the same errors as `GroundTruth.subset`."""
        chosen = np.asarray(rows)
        return Predictions.from_arrays(ttc_s=self.ttc_s[chosen], manifest=self.manifest.subset(chosen))

    def where(self, row: int) -> str:
        """Return the JSON pointer to the value of sequence `row`."""
        names = self.manifest.keys_of(self.keys) if self.names is None else self.names
        return pointer("predictions", names[row]) if self.enveloped else pointer(names[row])


def read_predictions(source: Source, *, manifest: Manifest, max_bytes: int | None = None) -> Predictions:
    """Read a prediction file and align it with `manifest`; raises `Rejected` with every fault.

    `source` is a path, bytes or an open file, in any form, of at most `max_bytes` as it is: a leaderboard
    takes 20,000,000, and None means no limit. The digest is that of the bytes; for a Parquet table, that of
    its JSON form. Raises `ModuleNotFoundError` for a Parquet table without pyarrow.
    """
    require(manifest, Manifest, name="manifest")
    data = data_of(source)
    if max_bytes is not None and len(data) > max_bytes:
        raise reject("too-large", too_large(n_bytes=len(data), max_bytes=max_bytes))
    return read_sent(as_sent(data), manifest=manifest)


def read_sent(data: bytes, *, manifest: Manifest) -> Predictions:
    """Read the forms that a leaderboard accepts, from untrusted bytes; else as `read_predictions`."""
    text = json_of(data, max_rows=2 * manifest.n_sequences + 100_000)
    column = read_column(text, manifest) or read_slowly(text, manifest)
    column.ttc_s.setflags(write=False)
    return Predictions(
        manifest=manifest,
        ttc_s=column.ttc_s,
        digest=sha256_digest(data),
        unit=column.document.unit,
        meta=column.document.meta,
        keys=column.keys,
        enveloped=column.document.enveloped,
    )


def sha256_digest(data: bytes) -> str:
    return "sha256:" + hashlib.sha256(data).hexdigest()


# --- files that are no JSON as they come: JSON in gzip, and CSV tables; a field that is no number becomes a
# --- JSON text, and is refused as one

MAX_UNPACKED_BYTES: Final = 64 * 1024 * 1024
"""What a gzip archive may unpack to, far above what the largest split needs."""

MAX_GZIP_MEMBERS: Final = 2_000
"""What a gzip archive may consist of: gzip and pigz write one member, bgzip one for each 64 KB of text."""

GZIP: Final = b"\x1f\x8b"
_CHUNK_BYTES: Final = 1 << 16
_PADDING: Final = re.compile(rb"\x00*")
MAX_COLUMNS: Final = 1_000
"""What a line of a CSV table may have, far more than the columns that are read."""

_NUMBER: Final = re.compile(
    r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|[+-]?(?:nan|inf|infinity)", re.IGNORECASE
)


def json_of(data: bytes, *, max_rows: int | None = None) -> bytes:
    """Return the JSON text of a prediction file; raises `Rejected` for a damaged or too large one."""
    is_unpacked = data.startswith(GZIP)
    if is_unpacked:
        data = _unpacked(data)
    line = headers.first_line(data)
    headers.require_commas(line)
    if headers.is_header(line):
        return _of_table(data, max_rows=max_rows)
    recognition.require_no_other_kind(data, is_unpacked=is_unpacked)
    return data


def _unpacked(data: bytes) -> bytes:
    """Unpack all members of a gzip archive, never beyond the limits."""
    parts, start, n_members, n_left = list[bytes](), 0, 0, MAX_UNPACKED_BYTES
    while start < len(data):
        n_members += 1
        if n_members > MAX_GZIP_MEMBERS:
            message = (
                f"The gzip archive has more than {MAX_GZIP_MEMBERS:,} members; expected at most "
                f"{MAX_GZIP_MEMBERS:,}, as gzip, pigz and bgzip write them."
            )
            raise reject("too-many-members", message, f"byte {start}")
        content, end = _member(data, start, max_bytes=n_left)
        parts.append(content)
        n_left -= len(content)
        padding = _PADDING.match(data, end)
        start = padding.end() if padding else end
    return b"".join(parts)


def _member(data: bytes, start: int, *, max_bytes: int) -> tuple[bytes, int]:
    """Unpack the member at `start`, at most `max_bytes`; returns its content and end."""
    # A child that reads files may open nothing, and zlib opens nothing.
    reader, parts = zlib.decompressobj(wbits=31), list[bytes]()
    while not reader.eof:
        if start >= len(data):
            raise reject(
                "not-json",
                "The file is not an intact gzip archive: it ends too early. Copy or write it again.",
            )
        # In pieces: zlib copies what comes behind the member's end.
        piece = data[start : start + _CHUNK_BYTES]
        try:
            parts.append(reader.decompress(piece, max_bytes + 1))
        except zlib.error as error:
            reason = str(error).rpartition(": ")[2]
            message = f"The file is not an intact gzip archive: {reason}. Copy or write it again."
            raise reject("not-json", message, f"byte {start:,}" if start else "") from None
        max_bytes -= len(parts[-1])
        if max_bytes < 0:
            message = f"The archive unpacks to more than {MAX_UNPACKED_BYTES:,} bytes; expected at most that."
            raise reject("too-large", message)
        start += len(piece) - len(reader.unused_data)
    return b"".join(parts), start


def _of_table(data: bytes, *, max_rows: int | None) -> bytes:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        message = f"Byte {error.start:,} of the table is not UTF-8; expected CSV text encoded in UTF-8."
        raise reject("not-utf8", message, f"byte {error.start}") from None
    body = text.lstrip()
    n_before = text[: len(text) - len(body)].count("\n")
    rows = csv.reader(_lines(body, max_rows=max_rows), strict=True)
    try:
        header = [name.strip() for name in next(rows)]
        return document_of(header, _checked(rows, header=header, n_before=n_before))
    except csv.Error as error:
        reason = "a quotation mark has no second one" if "end of data" in str(error) else str(error)
        message = f"This is not a CSV table: {reason}."
        raise reject("bad-csv", message, f"line {n_before + rows.line_num}") from None


def _lines(text: str, *, max_rows: int | None) -> Iterator[str]:
    """Yield a table's lines, header first; a long line is refused before its fields take memory."""
    for number, line in enumerate(io.StringIO(text, newline="")):
        if max_rows is not None and number > max_rows:
            message = f"The table has more than {max_rows:,} rows; expected one for each sequence."
            raise reject("too-many-members", message)
        n_fields = line.count(",") + 1
        if n_fields > MAX_COLUMNS:
            message = f"The line has up to {n_fields:,} fields; expected at most {MAX_COLUMNS:,}."
            raise reject("too-many-members", message, f"line {number + 1}")
        yield line


def _checked(rows: Any, *, header: Sequence[str], n_before: int) -> Iterator[list[str]]:
    """Yield the rows of a CSV reader that have a text; `n_before` lines precede its text."""
    for row in rows:
        # A spreadsheet writes rows without any text as commas alone.
        if not any(field.strip() for field in row):
            continue
        where = f"line {n_before + rows.line_num}"
        if len(row) != len(header):
            slip = headers.slip_of_row(row, header)
            message = (
                f"The row has {counted(len(row), 'field')}; expected {len(header):,}, as the header.{slip}"
            )
            raise reject("bad-csv", message, where)
        if [field.strip() for field in row] == header:
            raise reject("bad-csv", "The row repeats the header; expected it once. Remove this line.", where)
        yield row


def document_of(header: Sequence[str], rows: Iterable[Sequence[str | None]]) -> bytes:
    """Write the JSON text of a table: flat for seconds, an envelope for scale ratios; raises `Rejected`."""
    # Duplicate keys stay. A field of None has no value.
    keys, value, rate = headers.columns_of(header)
    columns = {name: header.index(name) for name in (*keys, value, *([rate] if rate else []))}
    key_positions = [columns[name] for name in keys]
    members, ratios = list[str](), list[str]()
    for row in rows:
        name = json.dumps("/".join((row[position] or "").strip() for position in key_positions))
        members.append(f"{name}:{_number(row[columns[value]])}")
        if rate is not None:
            ratios.append(f"{name}:{_number(row[columns[rate]])}")
    predictions, rates = (f"{{{','.join(each)}}}" for each in (members, ratios))
    if rate is None:
        return predictions.encode()
    return f'{{"unit":"scale_ratio","{rate}":{rates},"predictions":{predictions}}}'.encode()


def _number(text: str | None) -> str:
    """Write a field as JSON: the nearest float64, or the text for the reader to refuse.

    >>> _number(" 5.31"), _number("inf"), _number(""), _number(None)
    ('5.31', 'Infinity', '""', 'null')
    """
    if text is None:
        return "null"
    text = text.strip()
    return json.dumps(float(text)) if _NUMBER.fullmatch(text) else json.dumps(text)
