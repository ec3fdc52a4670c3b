"""Clips: the six frames of a sequence, decoded when they are first asked for, and the boxes of its object."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
"""Grey (height, width), or colour (height, width, 3) in OpenCV's order: blue, green, red."""

Box = NDArray[np.float64]
"""(4,): x1, y1, x2, y2 in pixels; the left edge of the first pixel is 0, so pixel centres lie at .5."""

N_FRAMES = 6
TARGET = N_FRAMES - 1
"""Frames are 0…5 in the order of time, 0.1 s apart; the last one is the target frame."""


@dataclass(frozen=True, slots=True)
class Clip:
    """One sequence: its key, boxes (6, 4) in pixels (NaN if absent), and `load(frame, colour)`."""

    anno_id: int
    boxes: NDArray[np.float64]
    load: Callable[[int, bool], Image]

    @classmethod
    def from_frames(cls, frames: Sequence[Image], *, boxes: NDArray[np.float64], anno_id: int = 0) -> Clip:
        """Make a clip of six images, all grey or all colour."""

        def load(frame: int, colour: bool) -> Image:
            image = frames[frame]
            if colour == (image.ndim == 3):
                return image
            code = cv2.COLOR_GRAY2BGR if colour else cv2.COLOR_BGR2GRAY
            return np.asarray(cv2.cvtColor(image, code), dtype=np.uint8)

        return cls(anno_id=anno_id, boxes=np.asarray(boxes, dtype=np.float64), load=load)

    def grey(self, frame: int) -> Image:
        """Return frame 0…5 as (height, width), uint8."""
        return self.load(frame, False)

    def colour(self, frame: int) -> Image:
        """Return frame 0…5 as (height, width, 3), uint8, blue first."""
        return self.load(frame, True)
