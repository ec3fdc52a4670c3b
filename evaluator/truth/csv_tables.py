"""Ground-truth tables on disk: CSV, the store, and the canonical text behind digests."""

from __future__ import annotations

import csv
import hashlib
import io
import operator
import os
import re
import struct
import zipfile
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from evaluator.arguments import Source, data_of
from evaluator.problems import Findings, quoted, reject
from evaluator.truth.objects import FIELDS, OBJECT_COLUMNS, text_of

COLUMNS: Final = ("anno_id", "bag_stamp", "cam_id", "ts", "track_id", "ttc")
MANIFEST_COLUMNS: Final = COLUMNS[:-1]
UNIT: Final = "unit"
"""The column by which a ground truth names the unit of each recording; most have none."""

_MAX_FIELD: Final = 200
_MAX_INT64: Final = 2**63 - 1
_WHOLE: Final = re.compile(r"[0-9]{1,19}", re.ASCII)
_STORE_KINDS: Final = {"anno_id": "i", "bag_stamp": "U", "cam_id": "U", "ts_ns": "i", "track_id": "U"}
_NOT_A_STORE: Final = (
    *(ValueError, EOFError, KeyError, TypeError, SyntaxError, RuntimeError, struct.error),
    *(zipfile.BadZipFile, zlib.error),
)
_NUMBER: Final = re.compile(
    r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|[+-]?(?:nan|inf|infinity)", re.IGNORECASE
)


@dataclass(slots=True)
class Table:
    """Columns as read, one item per sequence, and the source row of each for messages.

    `OBJECT_COLUMNS` and `unit` are empty if the source lacks them; None in the former is a missing value.
    """

    anno_id: list[int] = field(default_factory=list)
    bag_stamp: list[str] = field(default_factory=list)
    cam_id: list[str] = field(default_factory=list)
    ts_ns: list[int] = field(default_factory=list)
    track_id: list[str] = field(default_factory=list)
    ttc_s: list[float] = field(default_factory=list)
    locations: list[int] | list[str] = field(default_factory=list)
    occ_ratio: list[float | None] = field(default_factory=list)
    same_lane: list[bool | None] = field(default_factory=list)
    box2d: list[list[float] | None] = field(default_factory=list)
    unit: list[str] = field(default_factory=list)

    @property
    def manifest_columns(self) -> tuple[str, ...]:
        """The columns of its manifest, with `unit` if present."""
        return (*MANIFEST_COLUMNS, UNIT) if self.unit else MANIFEST_COLUMNS

    def where(self, row: int) -> str:
        """Return `line 3` of a CSV, or the source's name of the row."""
        if not self.locations:
            return f"row {row + 1}"
        location = self.locations[row]
        return location if isinstance(location, str) else f"line {location}"

    def subset(self, rows: Sequence[int]) -> Table:
        """These rows of every column that is there."""
        columns = {name: getattr(self, name) for name in Table.__slots__}
        return Table(**{name: [column[row] for row in rows] for name, column in columns.items() if column})

    def text(self, columns: tuple[str, ...], *, order: list[int] | None = None) -> str:
        """Return the table as CSV text in this row order, times to contact in shortest exact form."""
        lines = self._lines(columns)
        return _text(columns, lines if order is None else [lines[row] for row in order])

    def _lines(self, columns: tuple[str, ...]) -> list[str]:
        values = {
            "anno_id": map(str, self.anno_id),
            "bag_stamp": self.bag_stamp,
            "cam_id": self.cam_id,
            "ts": map(str, self.ts_ns),
            "track_id": self.track_id,
            "ttc": map(repr, self.ttc_s),
            UNIT: self.unit,
            **{name: map(text_of, getattr(self, name)) for name in OBJECT_COLUMNS},
        }
        return list(map(",".join, zip(*(values[name] for name in columns), strict=True)))

    def digests(self) -> tuple[str, str]:
        """Compute `sha256:…` of the manifest's text and of the whole table's (empty without times)."""
        # In ascending anno_id. A missing column `unit` does not change a digest.
        columns = self.manifest_columns
        lines = self._lines(columns)
        whole = list(map(",".join, zip(lines, map(repr, self.ttc_s), strict=True))) if self.ttc_s else []
        ids = self.anno_id
        if any(map(operator.gt, ids, ids[1:])):
            order = sorted(range(len(ids)), key=ids.__getitem__)
            lines, whole = ([some[row] for row in order] for some in (lines, whole or lines))
        return _digest(columns, lines), _digest((*columns, "ttc"), whole) if self.ttc_s else ""


def _text(columns: tuple[str, ...], lines: list[str]) -> str:
    return "\n".join([",".join(columns), *lines, ""])


def _digest(columns: tuple[str, ...], lines: list[str]) -> str:
    return "sha256:" + hashlib.sha256(_text(columns, lines).encode()).hexdigest()


@lru_cache(maxsize=4096)  # the same few names stand in thousands of rows
def name_fault(text: str) -> str | None:
    """Explain why `text` cannot be a bag_stamp, cam_id or track_id, else None."""
    # Natural keys join these words by "/", tables by ",".
    if not text:
        return "it is empty"
    if len(text) > _MAX_FIELD:
        return f"it is longer than {_MAX_FIELD} characters"
    for character in '/,"':
        if character in text:
            return f'it contains "{character}"' if character != '"' else "it contains a quotation mark"
    if not text.isprintable() or text != text.strip():
        return "it has control characters, or spaces at an end"
    return None


def read_text(source: Source) -> str:
    try:
        return data_of(source).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        where = Path(source).name if isinstance(source, str | os.PathLike) else ""
        raise reject("not-utf8", f"Byte {error.start:,} is not UTF-8.", where) from None


def require_one_column(header: Sequence[str], columns: Iterable[str], *, where: str) -> None:
    """Raise `Rejected` if the header has one of these columns twice: nothing says which one is meant."""
    for name in columns:
        n_columns = list(header).count(name)
        if n_columns > 1:
            raise reject(
                "bad-field", f"The table has {n_columns} columns {quoted(name)}; expected one.", where
            )


def read_csv(source: Source, *, with_ttc: bool) -> Table:
    """Read a CSV table; raises `Rejected`, by line, for missing columns and malformed fields."""
    # `COLUMNS` and `unit`, for a ground truth also `OBJECT_COLUMNS`; other columns are ignored.
    text = read_text(source)
    columns = COLUMNS if with_ttc else MANIFEST_COLUMNS
    rows = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        return _read_rows(rows, columns)
    except csv.Error as error:
        raise reject("bad-csv", f"This is not a CSV table: {error}.", f"line {rows.line_num}") from None


def _read_rows(rows: Any, columns: tuple[str, ...]) -> Table:
    header = [name.strip() for name in next(rows, [])]
    missing = [name for name in columns if name not in header]
    if missing:
        raise reject(
            "missing-columns",
            f"The table has no column {', '.join(missing)}; found {quoted(','.join(header))}, "
            f"expected {','.join(columns)}.",
            "line 1",
        )
    columns = (*columns, UNIT) if UNIT in header else columns
    require_one_column(header, (*columns, *(OBJECT_COLUMNS if "ttc" in columns else ())), where="line 1")
    positions = {name: header.index(name) for name in columns}
    extra = {name: header.index(name) for name in OBJECT_COLUMNS if name in header and "ttc" in columns}
    table, findings, locations = Table(), Findings(), []
    for row in rows:
        if not row:
            continue
        if len(row) != len(header):
            message = f"The row has {len(row)} fields; expected {len(header)}."
            findings.add("bad-csv", message, f"line {rows.line_num}")
            continue
        locations.append(rows.line_num)
        fields = {name: row[position] for name, position in positions.items()}
        _read_row(fields, table, findings, f"line {rows.line_num}")
        for name, position in extra.items():
            getattr(table, name).append(_of_object(name, row[position], findings, f"line {rows.line_num}"))
    findings.raise_if_any()
    table.locations = locations
    return table


def _read_row(fields: Mapping[str, str], table: Table, findings: Findings, where: str) -> None:
    table.anno_id.append(_whole("anno_id", fields["anno_id"], findings, where))
    table.ts_ns.append(_whole("ts", fields["ts"], findings, where))
    for name in ("bag_stamp", "cam_id", "track_id", UNIT):
        if name in fields:
            text = fields[name]
            getattr(table, name).append(text)
            if fault := name_fault(text):
                findings.add("bad-field", f"{name} is {quoted(text)}: {fault}.", where)
    if "ttc" in fields:
        text = fields["ttc"]
        if _NUMBER.fullmatch(text.strip()):
            table.ttc_s.append(float(text))
        else:
            findings.add("bad-field", f"ttc is {quoted(text)}; expected a number of seconds.", where)


def _of_object(name: str, text: str, findings: Findings, where: str) -> Any:
    try:
        return FIELDS[name](text.strip())
    except ValueError as expected:
        findings.add("bad-field", f"{name} is {quoted(text)}; expected {expected}.", where)
        return None


def _whole(name: str, text: str, findings: Findings, where: str) -> int:
    value = int(text) if _WHOLE.fullmatch(text.strip()) else -1
    if 0 <= value <= _MAX_INT64:
        return value
    findings.add("bad-field", f"{name} is {quoted(text)}; expected a whole number from 0 to 2^63 - 1.", where)
    return 0


def save_store(
    path: str | os.PathLike[str],
    *,
    columns: Mapping[str, NDArray[Any]],
    manifest_digest: str,
    truth_digest: str | None = None,
) -> None:
    """Write columns and digests as `.npz`, without pickles and uncompressed."""
    arrays: dict[str, Any] = {
        "manifest_digest": np.array(manifest_digest),
        **columns,
    }
    if truth_digest is not None:
        arrays["truth_digest"] = np.array(truth_digest)
    with Path(path).open("wb") as file:  # an open file, since numpy would add ".npz" to other names
        np.savez(file, **arrays)


def load_store(path: str | os.PathLike[str], *, with_ttc: bool) -> tuple[Table, str, str]:
    """Read a table, the manifest's digest and the truth's, if any; raises `Rejected` for other files."""
    path = Path(path)
    try:
        # numpy leaves its own file open when it fails.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as store:
            arrays = {name: store[name] for name in store.files}
    except OSError as error:
        raise reject(
            "unreadable", f"The file cannot be read: {error.strerror or error}.", path.name
        ) from None
    except _NOT_A_STORE as error:
        raise reject(
            "unreadable", f"The file is not a saved ground truth or manifest: {error}.", path.name
        ) from None
    kinds = _STORE_KINDS | ({"ttc_s": "f"} if with_ttc else {}) | ({UNIT: "U"} if UNIT in arrays else {})
    digests = {"manifest_digest", "truth_digest"} if with_ttc else {"manifest_digest"}
    shapes = {arrays[name].shape for name in kinds if name in arrays}
    if (
        not digests <= set(arrays)
        or any(name not in arrays or arrays[name].dtype.kind != kind for name, kind in kinds.items())
        or len(shapes) != 1
        or len(next(iter(shapes))) != 1
    ):
        expected = "ground truth" if with_ttc else "manifest"
        raise reject("unreadable", f"The file is not a saved {expected} of this version.", path.name)
    columns = {name: arrays[name].tolist() for name in kinds}
    names = (*columns["bag_stamp"], *columns["cam_id"], *columns["track_id"], *columns.get(UNIT, ()))
    if any(map(name_fault, names)) or min((*columns["anno_id"], *columns["ts_ns"], 0)) < 0:
        raise reject("bad-field", "The file holds malformed names or negative numbers.", path.name)
    return Table(**columns), str(arrays["manifest_digest"]), str(arrays.get("truth_digest", ""))
