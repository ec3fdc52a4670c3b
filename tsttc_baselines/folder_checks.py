"""Faults that all sequences of a folder share, checked before a method runs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluator.counting import counted
from evaluator.problems import Findings, reject
from tsttc_baselines.clips import TARGET
from tsttc_baselines.estimates import SequenceFault
from tsttc_baselines.folders import BOXES, SequenceFolder
from tsttc_baselines.images import ImageCache
from tsttc_baselines.methods import Method
from tsttc_baselines.sequence_checks import box_frames, image_frames, require_boxes

_MAX_BEYOND: Final = 1.05
_MAX_CAMERAS: Final = 8
_MAX_ROWS: Final = 16


def require_usable(folder: SequenceFolder, *, method: Method, frame_gap: int) -> None:
    """Raise `Rejected` for a folder without a needed box or image, or with boxes in other units."""
    frames = box_frames(method, frame_gap)
    usable = np.isfinite(folder.boxes[:, list(frames)]).all(axis=(1, 2))
    if not usable.any():
        names = " and ".join(map(str, frames))
        message = f"No sequence has boxes for the frames {names}; expected them for a gap of {frame_gap}."
        raise reject("bad-box", message, folder.boxes_from)
    _require_order(folder.boxes[usable][:, list(frames)], where=folder.boxes_from)
    if method.frames == "none":
        return
    if not any(folder.frame_path(row, TARGET).exists() for row in range(folder.n_sequences)):
        where = folder.where(folder.frame_path(0, TARGET))
        message = (
            "No sequence has an image of its target frame; expected the first one here, as .jpg or .png."
        )
        raise reject("bad-frame", message, where)
    if not folder.is_normalised:
        _require_pixels(folder)


def _require_order(boxes: NDArray[np.float64], *, where: str) -> None:
    """Raise `Rejected` where most boxes (n, frames, 4) end before they begin: two columns are swapped."""
    for low, name in ((0, "x"), (1, "y")):
        n_reversed = np.count_nonzero((boxes[..., low + 2] < boxes[..., low]).any(axis=1))
        if 2 * n_reversed > len(boxes):
            message = (
                f"{name}1 and {name}2 are swapped: {n_reversed:,} of {counted(len(boxes), 'sequence')} have "
                f"a box with {name}2 < {name}1; expected {name}1 < {name}2."
            )
            raise reject("bad-box", message, where)


def require_complete(folder: SequenceFolder, *, method: Method, frame_gap: int) -> None:
    """Raise `Rejected` with every sequence that lacks a box or an image, without decoding images."""
    findings = Findings()
    for row in range(folder.n_sequences):
        try:
            require_boxes(folder, row, box_frames(method, frame_gap))
            for frame in image_frames(method, frame_gap):
                folder.existing_path(row, frame)
        except SequenceFault as fault:
            findings.add(fault.problem.code, fault.problem.message, fault.problem.where)
    findings.raise_if_any()


def _require_pixels(folder: SequenceFolder) -> None:
    # Boxes lie in their own images. Images of one camera may have different sizes: rendered ones are crops.
    cache = ImageCache(max_bytes=0)
    for rows in _cameras(folder):
        sizes = {row: size for row in rows if (size := _size(folder, row, cache=cache)) is not None}
        if not sizes:
            continue
        size_px = np.array(list(sizes.values()))
        right_bottom = folder.boxes[list(sizes), TARGET, 2:]
        beyond = (right_bottom > _MAX_BEYOND * size_px).any(axis=1)
        if np.count_nonzero(beyond) * 2 > len(sizes):
            camera = f"cam{folder.manifest.cam_id[rows[0]]} in {folder.manifest.bag_stamp[rows[0]]}"
            right, bottom = np.nanmax(right_bottom, axis=0)
            width_px, height_px = size_px.max(axis=0)
            message = (
                f"{np.count_nonzero(beyond):,} of {len(sizes):,} target boxes of {camera} reach beyond its "
                f"images, to {right:g} and {bottom:g}; expected pixels of {width_px}×{height_px} images."
            )
            raise reject("bad-box", message, BOXES)


def _size(folder: SequenceFolder, row: int, *, cache: ImageCache) -> tuple[int, int] | None:
    try:
        return folder.size(row, cache=cache)
    except SequenceFault:
        return None


def _cameras(folder: SequenceFolder) -> Iterator[list[int]]:
    rows_of: dict[tuple[str, str], list[int]] = {}
    for row, key in enumerate(zip(folder.manifest.bag_stamp, folder.manifest.cam_id, strict=True)):
        rows_of.setdefault(key, []).append(row)
    for rows in list(rows_of.values())[:_MAX_CAMERAS]:
        yield rows[:: max(1, len(rows) // _MAX_ROWS)]
