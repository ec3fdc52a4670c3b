"""Tracks of vehicles from the label files of the KITTI tracking benchmark.

    {recording}.txt    frame track type truncated occluded alpha x1 y1 x2 y2 h w l x y z rotation_y

Camera coordinates: x right, y down, z forward; the location is the bottom's middle.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

from evaluator.hidden_files import is_hidden
from evaluator.problems import quoted, reject
from evaluator.truth.annotations import FRAME_STEP_NS
from evaluator.truth.csv_tables import name_fault, read_text
from tsttc_baselines.annotation.tracks import Collected, Tracks

CAMERA: Final = "2"
"""The left colour camera, which the boxes are of."""

VEHICLES: Final = ("Car", "Van", "Truck")
N_FIELDS: Final = 17


def read_kitti(folder: Path) -> Tracks:
    """Read the cars, vans and trucks of a folder of KITTI tracking labels, at 10 Hz.

    Raises `Rejected`, by file and line, for a folder without labels, and malformed, duplicate or unordered
    rows.
    """
    # Recordings are named by file stem; the camera is 2, ts the frame's number · 10⁸ ns.
    files = sorted(path for path in folder.glob("*.txt") if not is_hidden(path.relative_to(folder)))
    if not files:
        message = "The folder has no label files; expected KITTI tracking labels, one *.txt for a recording."
        raise reject("unreadable", message, folder.name)
    collected = Collected()
    for path in files:
        if fault := name_fault(path.stem):
            message = f"The file's name gives the bag_stamp {quoted(path.stem)}: {fault}."
            collected.findings.add("bad-field", message, path.name)
        for number, line in enumerate(read_text(path).splitlines(), start=1):
            if line.strip():
                _read_line(line.split(), collected, bag_stamp=path.stem, where=f"{path.name}, line {number}")
    return collected.tracks(has_radar=False)


def _read_line(fields: list[str], collected: Collected, *, bag_stamp: str, where: str) -> None:
    if len(fields) < N_FIELDS:
        message = f"The line has {len(fields)} fields; expected the {N_FIELDS} of KITTI tracking labels."
        collected.findings.add("bad-csv", message, where)
        return
    frame, track_id, kind, truncated = fields[:4]
    if kind not in VEHICLES:
        return
    if not (frame.isdecimal() and frame.isascii() and len(frame) < 10):
        message = f"The frame is {quoted(frame)}; expected a whole number from 0."
        collected.findings.add("bad-field", message, where)
        return
    try:
        truncation, *rest = map(float, (truncated, *fields[6:N_FIELDS]))
    except ValueError as error:
        message = f"A field is not a number: {error}; expected numbers after the type."
        collected.findings.add("bad-field", message, where)
        return
    *box_px, height, width, length, right, down, forward, rotation = rest
    collected.add(
        key=(bag_stamp, CAMERA, track_id),
        ts_ns=int(frame) * FRAME_STEP_NS,
        # rotation_y turns forward towards the left hand of x, which is against the yaw about an axis upwards.
        body=(right, forward, height / 2 - down, length, width, height, -rotation),
        box_px=box_px,
        is_truncated=truncation != 0,
        radar_mps=math.nan,
        where=where,
    )
