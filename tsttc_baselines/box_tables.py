"""`boxes.csv`: the boxes of the sequences' objects, `anno_id,frame,x1,y1,x2,y2`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluator.problems import Findings, listed, quoted, reject
from evaluator.truth.csv_tables import read_text, require_one_column
from evaluator.truth.ground_truth import Manifest
from tsttc_baselines.clips import N_FRAMES

COLUMNS: Final = ("anno_id", "frame", "x1", "y1", "x2", "y2")
NORMALISED: Final = "#unit=normalised"
PIXELS: Final = "#unit=pixels"
_MAX_NORMALISED: Final = 2.0
"""Boxes may reach beyond the image, but not by its whole size."""


def read_boxes(path: Path, *, manifest: Manifest) -> tuple[NDArray[np.float64], bool]:
    """Read boxes (n, 6, 4) in the manifest's order, NaN if absent, and whether they are normalised.

    Raises `Rejected`, by line, for a malformed table, duplicate boxes, unknown sequences or the wrong unit.
    """
    # Normalised: a line `#unit=normalised` before the header means parts of the image's size, 0…1.
    lines, is_normalised = _lines(path)
    boxes = np.full((manifest.n_sequences, N_FRAMES, 4), np.nan)
    line_of: dict[tuple[int, int], int] = {}
    findings, unknown = Findings(), dict[str, int]()
    for number, fields in _rows(lines):
        row = manifest.row_of_id.get(fields[0])
        if row is None:
            unknown.setdefault(fields[0], number)
        frame = int(fields[1]) if fields[1] in _FRAMES else None
        if frame is None:
            message = f"frame is {quoted(fields[1])}; expected 0 to {N_FRAMES - 1}, the target."
            findings.add("bad-field", message, f"{path.name}, line {number}")
        values = [_number(text) for text in fields[2:]]
        for name, text, value in zip(COLUMNS[2:], fields[2:], values, strict=True):
            if value is None:
                message = f"{name} is {quoted(text)}; expected a number."
                findings.add("bad-field", message, f"{path.name}, line {number}")
        if row is None or frame is None:
            continue
        earlier = line_of.setdefault((row, frame), number)
        if earlier != number:
            message = f"Frame {frame} of {fields[0]} already has a box in line {earlier}; expected one."
            findings.add("duplicate-keys", message, f"{path.name}, line {number}")
        boxes[row, frame] = [np.nan if value is None else value for value in values]
    if unknown:
        message = (
            f"The manifest lacks {len(unknown):,} of the anno_ids: {listed(list(unknown))}; expected its own."
        )
        findings.group(
            "unknown-keys", message, f"{path.name}, line {min(unknown.values())}", n_faults=len(unknown)
        )
    findings.raise_if_any()
    _check_unit(boxes, path, is_normalised=is_normalised)
    return boxes, is_normalised


_FRAMES: Final = {str(frame) for frame in range(N_FRAMES)}


def _lines(path: Path) -> tuple[list[tuple[int, str]], bool]:
    lines = list(enumerate(read_text(path).splitlines(), start=1))
    units = {line.replace(" ", "") for _, line in lines if line.replace(" ", "").startswith("#unit=")}
    if units - {NORMALISED, PIXELS} or len(units) > 1:
        stated = quoted(", ".join(sorted(units)))
        message = f"The unit is {stated}; expected {NORMALISED}, {PIXELS} or no such line."
        raise reject("bad-field", message, path.name)
    return [(n, line) for n, line in lines if line.strip() and not line.startswith("#")], NORMALISED in units


def _rows(lines: list[tuple[int, str]]) -> Iterator[tuple[int, list[str]]]:
    name = "boxes.csv"
    header = [field.strip(' "\t') for field in lines[0][1].split(",")] if lines else []
    missing = [column for column in COLUMNS if column not in header]
    if missing:
        message = (
            f"The table has no column {', '.join(missing)}; found {quoted(','.join(header))}, "
            f"expected {','.join(COLUMNS)}."
        )
        raise reject("missing-columns", message, f"{name}, line {lines[0][0] if lines else 1}")
    require_one_column(header, COLUMNS, where=f"{name}, line {lines[0][0]}")
    positions = [header.index(column) for column in COLUMNS]
    for number, line in lines[1:]:
        fields = line.split(",")
        if len(fields) != len(header):
            message = f"The row has {len(fields)} fields; expected {len(header)}."
            raise reject("bad-csv", message, f"{name}, line {number}")
        yield number, [fields[position].strip(' "\t') for position in positions]


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _check_unit(boxes: NDArray[np.float64], path: Path, *, is_normalised: bool) -> None:
    finite = boxes[np.isfinite(boxes)]
    largest = float(np.abs(finite).max()) if finite.size else None
    if largest is None:
        raise reject(
            "bad-box", "The table has no box; expected one for each target frame at least.", path.name
        )
    if is_normalised and largest > _MAX_NORMALISED:
        message = (
            f"The largest coordinate is {largest:g} after {NORMALISED}; expected parts of the image, 0 to 1."
        )
        raise reject("bad-box", message, path.name)
    if not is_normalised and largest <= 1:
        message = (
            f"The largest coordinate is {largest:g}, which is not a pixel; "
            f"expected pixels, or {NORMALISED} as the first line where coordinates are parts of the image."
        )
        raise reject("bad-box", message, path.name)
