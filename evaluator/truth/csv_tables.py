"""Ground-truth tables on disk: CSV, the store, and the canonical text behind digests."""

from __future__ import annotations

import csv
import hashlib
import io
import re
import struct
import zipfile
import zlib
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from evaluator.problems import Findings, quoted, reject

COLUMNS: Final = ("anno_id", "bag_stamp", "cam_id", "ts", "track_id", "ttc")
MANIFEST_COLUMNS: Final = COLUMNS[:-1]

_STORE_FORMAT: Final = 1
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
    """Columns as they were read, one item per sequence, and the place of each row for messages."""

    anno_id: list[int] = field(default_factory=list)
    bag_stamp: list[str] = field(default_factory=list)
    cam_id: list[str] = field(default_factory=list)
    ts_ns: list[int] = field(default_factory=list)
    track_id: list[str] = field(default_factory=list)
    ttc_s: list[float] = field(default_factory=list)
    places: list[int] | list[str] = field(default_factory=list)

    def where(self, row: int) -> str:
        """`line 3` of a CSV, or whatever the source calls the row."""
        if not self.places:
            return f"row {row + 1}"
        place = self.places[row]
        return place if isinstance(place, str) else f"line {place}"

    def text(self, columns: tuple[str, ...], *, order: list[int] | None = None) -> str:
        """The table as CSV text in the given row order, times to contact in their shortest exact spelling."""
        values = {
            "anno_id": map(str, self.anno_id),
            "bag_stamp": self.bag_stamp,
            "cam_id": self.cam_id,
            "ts": map(str, self.ts_ns),
            "track_id": self.track_id,
            "ttc": map(repr, self.ttc_s),
        }
        lines = list(map(",".join, zip(*(values[name] for name in columns), strict=True)))
        if order is not None:
            lines = [lines[row] for row in order]
        return "\n".join([",".join(columns), *lines, ""])

    def digest(self, columns: tuple[str, ...]) -> str:
        """`sha256:…` of the text with its rows in ascending anno_id."""
        ids = self.anno_id
        order = sorted(range(len(ids)), key=ids.__getitem__)
        return "sha256:" + hashlib.sha256(self.text(columns, order=order).encode()).hexdigest()


@lru_cache(maxsize=4096)  # the same few names stand in thousands of rows
def name_fault(text: str) -> str | None:
    """Why `text` cannot be a bag_stamp, cam_id or track_id; None when it can.

    These words are joined by "/" in natural keys and by "," in tables, so they must be free of both.

    >>> name_fault("0007"), name_fault("a/b")
    (None, 'it contains "/"')
    """
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


def read_text(path: Path) -> str:
    """The text of a UTF-8 file, with or without a byte order mark. Raises `Rejected`."""
    try:
        return path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise reject("unreadable", f"The file cannot be read: {error.strerror}.", path.name) from None
    except UnicodeDecodeError as error:
        raise reject("not-utf8", f"Byte {error.start:,} is not UTF-8.", path.name) from None


def read_csv(path: Path, *, with_ttc: bool) -> Table:
    """Read `COLUMNS` from a CSV file with a header; more columns are ignored, their order is free.

    Raises `Rejected` for an unreadable file, missing columns and malformed fields, by line.
    """
    text = read_text(path)
    rows = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        return _read_rows(rows, COLUMNS if with_ttc else MANIFEST_COLUMNS)
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
    positions = [header.index(name) for name in columns]
    table, findings, places = Table(), Findings(), []
    for row in rows:
        if not row:
            continue
        if len(row) != len(header):
            found = f"The row has {len(row)} fields; expected {len(header)}."
            findings.add("bad-csv", found, f"line {rows.line_num}")
            continue
        places.append(rows.line_num)
        _read_row([row[position] for position in positions], table, findings, f"line {rows.line_num}")
    findings.raise_if_any()
    table.places = places
    return table


def _read_row(fields: list[str], table: Table, findings: Findings, where: str) -> None:
    anno_id, bag_stamp, cam_id, ts, track_id, *ttc = fields
    table.anno_id.append(_whole("anno_id", anno_id, findings, where))
    table.ts_ns.append(_whole("ts", ts, findings, where))
    for column, name, text in (
        (table.bag_stamp, "bag_stamp", bag_stamp),
        (table.cam_id, "cam_id", cam_id),
        (table.track_id, "track_id", track_id),
    ):
        column.append(text)
        fault = name_fault(text)
        if fault:
            findings.add("bad-field", f"{name} is {quoted(text)}: {fault}.", where)
    for text in ttc:
        if _NUMBER.fullmatch(text.strip()):
            table.ttc_s.append(float(text))
        else:
            findings.add("bad-field", f"ttc is {quoted(text)}; expected a number of seconds.", where)


def _whole(name: str, text: str, findings: Findings, where: str) -> int:
    value = int(text) if _WHOLE.fullmatch(text.strip()) else -1
    if 0 <= value <= _MAX_INT64:
        return value
    findings.add("bad-field", f"{name} is {quoted(text)}; expected a whole number from 0 to 2^63 - 1.", where)
    return 0


def save_store(
    path: str | Path, *, table: Table, manifest_digest: str, truth_digest: str | None = None
) -> None:
    """Write columns and digests as an `.npz` without pickled objects.

    It is not compressed: that took three times as long as everything else, and the files are few.
    """
    arrays: dict[str, Any] = {
        "format": np.array(_STORE_FORMAT),
        "manifest_digest": np.array(manifest_digest),
        "anno_id": np.array(table.anno_id, dtype=np.int64),
        "bag_stamp": np.array(table.bag_stamp, dtype=np.str_),
        "cam_id": np.array(table.cam_id, dtype=np.str_),
        "ts_ns": np.array(table.ts_ns, dtype=np.int64),
        "track_id": np.array(table.track_id, dtype=np.str_),
    }
    if truth_digest is not None:
        arrays |= {"truth_digest": np.array(truth_digest), "ttc_s": np.array(table.ttc_s, dtype=np.float64)}
    with Path(path).open("wb") as file:  # an open file, since numpy would add ".npz" to other names
        np.savez(file, **arrays)


def load_store(path: str | Path, *, with_ttc: bool) -> tuple[Table, str]:
    """The table and the digest that `save_store` wrote; raises `Rejected` for anything else."""
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
            "unreadable", f"The file is no saved ground truth or manifest: {error}.", path.name
        ) from None
    kinds = _STORE_KINDS | ({"ttc_s": "f"} if with_ttc else {})
    digest = arrays.get("truth_digest" if with_ttc else "manifest_digest")
    shapes = {arrays[name].shape for name in kinds if name in arrays}
    if (
        digest is None
        or any(name not in arrays or arrays[name].dtype.kind != kind for name, kind in kinds.items())
        or len(shapes) != 1
        or len(next(iter(shapes))) != 1
    ):
        expected = "ground truth" if with_ttc else "manifest"
        raise reject("unreadable", f"The file is no saved {expected} of this version.", path.name)
    columns = {name: arrays[name].tolist() for name in kinds}
    names = (*columns["bag_stamp"], *columns["cam_id"], *columns["track_id"])
    if any(map(name_fault, names)) or min((*columns["anno_id"], *columns["ts_ns"], 0)) < 0:
        raise reject("bad-field", "The file holds malformed names or negative numbers.", path.name)
    return Table(**columns), str(digest)
