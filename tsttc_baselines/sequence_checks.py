"""Faults of a sequence's boxes, each with a short reason for counting and a sentence."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

from evaluator.problems import Problem
from tsttc_baselines.clips import TARGET, Clip
from tsttc_baselines.estimates import SequenceFault
from tsttc_baselines.folders import SequenceFolder
from tsttc_baselines.methods import Method

MIN_SIDE_PX: Final = 4.0


def box_frames(method: Method, frame_gap: int) -> tuple[int, ...]:
    return (TARGET,) if method.boxes == "target" else (TARGET - frame_gap, TARGET)


def image_frames(method: Method, frame_gap: int) -> tuple[int, ...]:
    if method.frames == "none":
        return ()
    reference = TARGET - frame_gap
    return (reference, TARGET) if method.frames == "pair" else tuple(range(reference, TARGET + 1))


def require_boxes(folder: SequenceFolder, row: int, frames: Iterable[int]) -> None:
    """Raise `SequenceFault` for a missing, non-numeric, reversed or empty box."""
    for frame in frames:
        x1, y1, x2, y2 = box = folder.boxes[row, frame].tolist()
        name = "target" if frame == TARGET else f"reference frame {frame}"
        statement = f"The box of the {name} is {_shown(box)}"
        if all(map(math.isnan, box)):
            kind = "target" if frame == TARGET else "reference"
            message = f"There is no box for the {name}; expected one."
            raise _fault(folder, row, f"no box in the {kind} frame", message)
        if not all(map(math.isfinite, box)):
            raise _fault(folder, row, "box is not a number", f"{statement}; expected numbers.")
        if x2 < x1 or y2 < y1:
            raise _fault(folder, row, "box is reversed", f"{statement}; expected x1 < x2 and y1 < y2.")
        if x2 == x1 or y2 == y1:
            raise _fault(folder, row, "box is empty", f"{statement}; expected an area.")


def require_sizes(
    folder: SequenceFolder,
    clip: Clip,
    row: int,
    frames: Iterable[int],
    *,
    image_px: tuple[int, int] | None,
) -> None:
    """Raise `SequenceFault` for a box too small, or outside of its image of `image_px` (width, height)."""
    for frame in frames:
        x1, y1, x2, y2 = box = clip.boxes[frame].tolist()
        statement = f"The box of frame {frame} is {_shown(box)}"
        if min(x2 - x1, y2 - y1) < MIN_SIDE_PX:
            message = f"{statement}; expected sides of at least {MIN_SIDE_PX:g} px."
            raise _fault(folder, row, f"box is smaller than {MIN_SIDE_PX:g} px", message)
        if image_px is not None and (x2 <= 0 or y2 <= 0 or x1 >= image_px[0] or y1 >= image_px[1]):
            message = f"{statement}; expected one inside of {image_px[0]}×{image_px[1]} px."
            raise _fault(folder, row, "box lies outside the image", message)


def _fault(folder: SequenceFolder, row: int, reason: str, message: str) -> SequenceFault:
    where = f"{folder.boxes_from}, sequence {folder.manifest.anno_id[row]}"
    return SequenceFault(reason, Problem("bad-box", message, where))


def _shown(box: list[float]) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in box) + ")"
