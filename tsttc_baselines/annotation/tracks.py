"""Tracks of 3D boxes: the table `track.csv`, and the checks of both kinds of input.

    bag_stamp,cam_id,track_id,ts,x,y,z,length,width,height,yaw,box_x1,box_y1,box_x2,box_y2,truncated

and, with a radar, `radar_velocity`. Metres in vehicle coordinates (x right, y forward, z up); yaw in radians
about z; boxes in pixels; ts in ns; velocities in m/s, negative for approaching objects. Other columns are
ignored.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluator.metrics.scale import Floats
from evaluator.problems import Findings, quoted, reject
from evaluator.truth.csv_tables import name_fault, read_text, require_one_column

NAMES: Final = ("bag_stamp", "cam_id", "track_id")
BODY: Final = ("x", "y", "z", "length", "width", "height", "yaw")
BOX: Final = ("box_x1", "box_y1", "box_x2", "box_y2")
RADAR: Final = "radar_velocity"
COLUMNS: Final = (*NAMES, "ts", *BODY, *BOX, "truncated")

_SIZES: Final = slice(3, 6)
_MAX_DIGITS: Final = 18

Key = tuple[str, str, str]
"""Recording, camera, track."""


@dataclass(frozen=True, eq=False)
class Tracks:
    """n observations of vehicles, those of each track in order of time.

    `centre_m` and `size_m` (length, width, height) are (n, 3), `box_px` (n, 4), NaN without a box;
    `radar_mps` is NaN without a velocity.
    """

    key: tuple[Key, ...]
    ts_ns: NDArray[np.int64]
    centre_m: Floats
    size_m: Floats
    yaw_rad: Floats
    box_px: Floats
    is_truncated: NDArray[np.bool_]
    radar_mps: Floats
    has_radar: bool

    @property
    def n_observations(self) -> int:
        return len(self.key)


@dataclass
class Collected:
    findings: Findings = field(default_factory=Findings)
    key: list[Key] = field(default_factory=list)
    ts_ns: list[int] = field(default_factory=list)
    body: list[Sequence[float]] = field(default_factory=list)
    box_px: list[Sequence[float]] = field(default_factory=list)
    is_truncated: list[bool] = field(default_factory=list)
    radar_mps: list[float] = field(default_factory=list)
    _last: dict[Key, tuple[int, str]] = field(default_factory=dict)

    def add(
        self,
        *,
        key: Key,
        ts_ns: int,
        body: Sequence[float],
        box_px: Sequence[float],
        is_truncated: bool,
        radar_mps: float,
        where: str,
    ) -> None:
        self._check_numbers(body, box_px, radar_mps, where)
        self._check_time(key, ts_ns, where)
        self.key.append(key)
        self.ts_ns.append(ts_ns)
        self.body.append(body)
        self.box_px.append(box_px)
        self.is_truncated.append(is_truncated)
        self.radar_mps.append(radar_mps)

    def _check_numbers(
        self, body: Sequence[float], box_px: Sequence[float], radar_mps: float, where: str
    ) -> None:
        for name, value in zip(BODY, body, strict=True):
            if not math.isfinite(value):
                self.findings.add("bad-field", f"{name} is {value}; expected a finite number.", where)
        for name, value in zip(BODY[_SIZES], body[_SIZES], strict=True):
            if value <= 0:
                message = f"{name} is {value:g} m; expected a size above 0."
                self.findings.add("bad-field", message, where)
        if math.isinf(radar_mps):
            message = f"{RADAR} is {radar_mps}; expected a finite number, or nothing."
            self.findings.add("bad-field", message, where)
        x1, y1, x2, y2 = box_px
        n_numbers = sum(map(math.isfinite, box_px))
        if n_numbers not in {0, 4} or any(map(math.isinf, box_px)) or x2 < x1 or y2 < y1:
            message = (
                f"The box is {x1:g}, {y1:g}, {x2:g}, {y2:g}; expected its left, top, right and bottom edge, "
                "or four empty fields."
            )
            self.findings.add("bad-box", message, where)

    def _check_time(self, key: Key, ts_ns: int, where: str) -> None:
        last_ns, last_where = self._last.get(key, (-1, ""))
        name = "/".join(key)
        if ts_ns == last_ns:
            message = (
                f"The track {quoted(name)} already has ts {ts_ns}, at {last_where}; "
                "expected one row for a frame."
            )
            self.findings.add("duplicate-keys", message, where)
        elif ts_ns < last_ns:
            message = (
                f"ts is {ts_ns}, earlier than {last_ns} at {last_where}, of the same track {quoted(name)}; "
                "expected the rows of a track in the order of time."
            )
            self.findings.add("reversed-time", message, where)
        self._last[key] = (ts_ns, where)

    def tracks(self, *, has_radar: bool) -> Tracks:
        """Return all rows; raises `Rejected` for noted faults and for no rows."""
        self.findings.raise_if_any()
        if not self.key:
            raise reject("empty", "There are no tracked vehicles; expected at least one.")
        body = np.array(self.body, dtype=np.float64)
        return Tracks(
            key=tuple(self.key),
            ts_ns=np.array(self.ts_ns, dtype=np.int64),
            centre_m=body[:, :3],
            size_m=body[:, _SIZES],
            yaw_rad=body[:, -1],
            box_px=np.array(self.box_px, dtype=np.float64),
            is_truncated=np.array(self.is_truncated),
            radar_mps=np.array(self.radar_mps, dtype=np.float64),
            has_radar=has_radar,
        )


def read_tracks(path: Path) -> Tracks:
    """Read `track.csv`; raises `Rejected`, by line, for malformed, duplicate or unordered rows."""
    rows = csv.reader(io.StringIO(read_text(path), newline=""), strict=True)
    try:
        return _read_rows(rows, next(rows, []))
    except csv.Error as error:
        message = f"This is not a CSV table: {error}."
        raise reject("bad-csv", message, f"line {getattr(rows, 'line_num', 1)}") from None


def _read_rows(rows: Iterator[list[str]], header: list[str]) -> Tracks:
    header = [name.strip() for name in header]
    missing = [name for name in COLUMNS if name not in header]
    if missing:
        message = (
            f"The table has no column {', '.join(missing)}; found {quoted(','.join(header))}, "
            f"expected {','.join(COLUMNS)}."
        )
        raise reject("missing-columns", message, "line 1")
    require_one_column(header, (*COLUMNS, RADAR), where="line 1")
    has_radar = RADAR in header
    positions = [header.index(name) for name in (*COLUMNS, *([RADAR] if has_radar else []))]
    collected = Collected()
    for number, row in enumerate(rows, start=2):
        if not row:
            continue
        where = f"line {number}"
        if len(row) != len(header):
            message = f"The row has {len(row)} fields; expected {len(header)}."
            collected.findings.add("bad-csv", message, where)
            continue
        _read_row([row[position].strip() for position in positions], collected, where)
    return collected.tracks(has_radar=has_radar)


def _read_row(fields: list[str], collected: Collected, where: str) -> None:
    *names, ts = fields[:4]
    findings = collected.findings
    for name, text in zip(NAMES, names, strict=True):
        if fault := name_fault(text):
            findings.add("bad-field", f"{name} is {quoted(text)}: {fault}.", where)
    if not (ts.isdecimal() and ts.isascii() and len(ts) <= _MAX_DIGITS):
        message = f"ts is {quoted(ts)}; expected a whole number of nanoseconds from 0."
        findings.add("bad-field", message, where)
        ts = "0"
    *boxes, truncated = fields[11:16]
    if truncated not in {"0", "1"}:
        findings.add("bad-field", f"truncated is {quoted(truncated)}; expected 0 or 1.", where)
    collected.add(
        key=(names[0], names[1], names[2]),
        ts_ns=int(ts),
        body=[_number(*pair, findings, where) for pair in zip(BODY, fields[4:11], strict=True)],
        box_px=[_number_or_gap(*pair, findings, where) for pair in zip(BOX, boxes, strict=True)],
        is_truncated=truncated == "1",
        radar_mps=_number_or_gap(RADAR, "".join(fields[16:]), findings, where),
        where=where,
    )


def _number(name: str, text: str, findings: Findings, where: str) -> float:
    try:
        return float(text)
    except ValueError:
        findings.add("bad-field", f"{name} is {quoted(text)}; expected a number.", where)
        return 1.0


def _number_or_gap(name: str, text: str, findings: Findings, where: str) -> float:
    return _number(name, text, findings, where) if text else math.nan
