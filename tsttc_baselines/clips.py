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
    """One sequence: its number, its boxes and its six frames.

    - `anno_id`: the number of the sequence.
    - `boxes`: an array of shape (6, 4), for each frame x1, y1, x2, y2 in pixels. A missing box is NaN.
    - `load`: returns a frame: `load(frame, colour)` with the number 0 to 5, and true for colour or false for
      grey.
    """

    anno_id: int
    boxes: NDArray[np.float64]
    load: Callable[[int, bool], Image]

    @classmethod
    def from_frames(cls, frames: Sequence[Image], *, boxes: NDArray[np.float64], anno_id: int = 0) -> Clip:
        """Make a clip of six images, which are all grey or all in colour."""

        def load(frame: int, colour: bool) -> Image:
            image = frames[frame]
            if colour == (image.ndim == 3):
                return image
            code = cv2.COLOR_GRAY2BGR if colour else cv2.COLOR_BGR2GRAY
            return np.asarray(cv2.cvtColor(image, code), dtype=np.uint8)

        return cls(anno_id=anno_id, boxes=np.asarray(boxes, dtype=np.float64), load=load)

    def grey(self, frame: int) -> Image:
        """Return a frame, 0 to 5, in grey: an array of shape (height, width) of uint8."""
        return self.load(frame, False)

    def colour(self, frame: int) -> Image:
        """Return a frame, 0 to 5, in colour: (height, width, 3) of uint8, in the order blue, green, red."""
        return self.load(frame, True)
