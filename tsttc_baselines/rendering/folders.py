"""Rendered sequences as a folder of the convention: manifest, boxes, truth and images."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from evaluator.truth.annotations import FRAME_STEP_NS
from evaluator.truth.csv_tables import COLUMNS, MANIFEST_COLUMNS
from tsttc_baselines.clips import N_FRAMES
from tsttc_baselines.folders import BOXES, IMAGES, MANIFEST, TRUTH
from tsttc_baselines.highway import Floats
from tsttc_baselines.processes import worked_through
from tsttc_baselines.rendering.clips import render
from tsttc_baselines.simulation import Split

PART = "render.part"
"""What an interrupted rendering has left; a whole folder has none."""


class OtherRendering(Exception):
    """The folder holds an interrupted rendering of other sequences."""


Progress = Callable[[int], None]


class Renderer:
    def __init__(self, *, split: Split, seed: int, images: Path) -> None:
        self._split = split
        self._seed = seed
        self._images = images
        cv2.setNumThreads(1)

    def __call__(self, row: int) -> tuple[int, Floats]:
        """Write the six images of a sequence; return its row, and its boxes (6, 4)."""
        rendered = render(self._split, anno_id=row, seed=self._seed)
        for frame, jpeg in enumerate(rendered.jpegs):
            image_path(self._split, row, frame, images=self._images).write_bytes(jpeg)
        return row, rendered.boxes


def image_path(split: Split, row: int, frame: int, *, images: Path) -> Path:
    ts_ns = split.table.ts_ns[row] - (N_FRAMES - 1 - frame) * FRAME_STEP_NS
    return images / split.table.bag_stamp[row] / f"cam{split.table.cam_id[row]}" / f"{ts_ns}.jpg"


def write_folder(
    split: Split,
    *,
    seed: int,
    path: Path,
    rows: Sequence[int],
    n_processes: int = 1,
    progress: Progress = lambda _n_done: None,
) -> None:
    """Render rows of a split into `path`, an empty or new folder.

    An interrupted call leaves the boxes in `PART`; the same call continues. Raises `OtherRendering` for those
    of another call, `OSError` and `WorkerEnded`.
    """
    # The manifest comes last: a folder that has one is complete.
    images = path / IMAGES
    path.mkdir(parents=True, exist_ok=True)
    boxes = _begun(path / PART, key={"split": split.truth.digest, "seed": seed, "rows": [rows[0], len(rows)]})
    for row in rows:
        image_path(split, row, 0, images=images).parent.mkdir(parents=True, exist_ok=True)
    make = partial(Renderer, split=split, seed=seed, images=images)
    left = [row for row in rows if row not in boxes]
    progress(len(boxes))
    with (
        (path / PART).open("a") as part,
        closing(worked_through(make, left, n_processes=n_processes)) as pieces,
    ):
        for piece in pieces:
            for row, of_frames in piece:
                boxes[row] = of_frames
                part.write(json.dumps([row, of_frames.tolist()]) + "\n")
            part.flush()
            progress(len(boxes))
    lines = ["anno_id,frame,x1,y1,x2,y2"]
    lines += [
        f"{row},{frame}," + ",".join(f"{edge:.2f}" for edge in boxes[row][frame].tolist())
        for row in rows
        for frame in range(N_FRAMES)
    ]
    (path / BOXES).write_text("\n".join([*lines, ""]))
    chosen = np.array(rows).tolist()
    (path / TRUTH).write_text(split.table.text(COLUMNS, order=chosen))
    (path / MANIFEST).write_text(split.table.text(MANIFEST_COLUMNS, order=chosen))
    (path / PART).unlink()


def _begun(part: Path, *, key: dict[str, Any]) -> dict[int, Floats]:
    """The boxes of an interrupted call with this key, by row; begins the file where there was none."""
    lines = part.read_text().splitlines(keepends=True) if part.exists() else []
    whole = [line for line in lines if line.endswith("\n")]  # the last one may be cut off
    if whole and json.loads(whole[0]) != key:
        raise OtherRendering
    lines = whole or [json.dumps(key) + "\n"]
    part.write_text("".join(lines))
    return {row: np.array(boxes) for row, boxes in map(json.loads, lines[1:])}
