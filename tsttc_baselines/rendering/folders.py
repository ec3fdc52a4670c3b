"""Rendered sequences as a folder of the convention: manifest, boxes, truth and images."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path

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
    """Render rows of a split into `path`, an empty or new folder; raises `OSError` and `WorkerEnded`."""
    # The manifest comes last: a folder that has one is complete.
    images = path / IMAGES
    for row in rows:
        image_path(split, row, 0, images=images).parent.mkdir(parents=True, exist_ok=True)
    make = partial(Renderer, split=split, seed=seed, images=images)
    boxes: dict[int, Floats] = {}
    with closing(worked_through(make, rows, n_processes=n_processes)) as pieces:
        for piece in pieces:
            boxes |= dict(piece)
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
