"""Patches: a part of a frame as grey levels, sampled on even grids between the pixels."""

# The frame's border repeats outside, so that no sequence is dropped for its position.

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tsttc_baselines.boxes import centre_of, is_usable, size_of
from tsttc_baselines.clips import TARGET, Clip, Image
from tsttc_baselines.estimates import Unusable

Floats = NDArray[np.float64]
Pixels = NDArray[np.float32]

MAX_CELLS: Final = 64
"""Unless told otherwise, a patch has at most so many cells along its longer side; greater boxes are compared
more coarsely.
"""

MIN_SIDE_PX: Final = 4.0
"""A narrower box shows nothing that could be compared."""

MIN_CONTRAST: Final = 1.0
"""Least standard deviation of a patch in grey levels; below, every place matches as well as any other."""


_MAX_ROW: Final = 2**15 - 1
"""Cells in a row of what OpenCV samples at once."""


@dataclass(frozen=True, slots=True)
class Window:
    """A part of a frame: `pixels` float32 (rows, columns), or (rows, columns, 3), in grey levels 0 … 255."""

    # `origin` is the top left corner, `pixel_size` the size of a pixel, (2,), x and y, in pixels of the
    # frame.

    pixels: Pixels
    origin: Floats
    pixel_size: Floats

    def shrunk(self, pixel_size: float) -> Window:
        """Average pixels to about `pixel_size` old ones, so that texture does not alias."""
        rows, columns = self.pixels.shape[:2]
        n_columns, n_rows = max(1, round(columns / pixel_size)), max(1, round(rows / pixel_size))
        pixels = cv2.resize(self.pixels, (n_columns, n_rows), interpolation=cv2.INTER_AREA)
        growth = np.array([columns / n_columns, rows / n_rows])
        return Window(np.asarray(pixels, dtype=np.float32), self.origin, self.pixel_size * growth)

    def darker(self, levels: float) -> Window:
        return Window(self.pixels - np.float32(levels), self.origin, self.pixel_size)

    def sample(self, x: ArrayLike, y: ArrayLike) -> Pixels:
        """Sample bilinearly at `x` (n, columns), `y` (n, rows) of the frame: (n, rows, columns[, 3])."""
        columns = ((np.asarray(x) - self.origin[0]) / self.pixel_size[0] - 0.5).astype(np.float32)
        rows = ((np.asarray(y) - self.origin[1]) / self.pixel_size[1] - 0.5).astype(np.float32)
        shape = (len(columns), rows.shape[1], columns.shape[1])
        # One call for all grids, one below the other: OpenCV takes longer to start than to sample a patch.
        # All cells of a grid are one row where it may be so long: OpenCV works faster along long rows.
        row = shape[1] * shape[2] if shape[1] * shape[2] <= _MAX_ROW else shape[2]
        maps = np.empty((2, *shape), dtype=np.float32)
        maps[0], maps[1] = columns[:, np.newaxis, :], rows[:, :, np.newaxis]
        map_x, map_y = maps[0].reshape(-1, row), maps[1].reshape(-1, row)
        sampled = cv2.remap(self.pixels, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(sampled, dtype=np.float32).reshape(shape + self.pixels.shape[2:])


def cut(image: Image, *, centre: ArrayLike, size: ArrayLike, pixel_size: float = 1.0) -> Window:
    """Cut the window about `centre` of at least `size`, with pixels of about `pixel_size`, at least 1."""
    # Plain numbers: for two of them, NumPy takes ten times as long.
    (x, y), (width, height) = np.asarray(centre).tolist(), np.asarray(size).tolist()
    left, right = _ends(x, width / 2 + pixel_size)  # a pixel more for the interpolation
    top, bottom = _ends(y, height / 2 + pixel_size)
    pixels = with_border(image, (left, top), (right, bottom))
    window = Window(pixels, np.array([left, top], dtype=np.float64), np.ones(2))
    return window.shrunk(pixel_size) if pixel_size > 1.0 else window


def _ends(middle: float, half: float) -> tuple[int, int]:
    return math.floor(middle - half), math.ceil(middle + half)


def with_border(image: Image, low: tuple[int, int], high: tuple[int, int]) -> Pixels:
    """Cut columns and rows `low` … `high` (x, y), also outside the image, where the border repeats."""
    height, width = image.shape[:2]
    left, right = min(max(low[0], 0), width - 1), max(1, min(high[0], width))
    top, bottom = min(max(low[1], 0), height - 1), max(1, min(high[1], height))
    inside = image[top:bottom, left:right].astype(np.float32)
    sides = (max(top - low[1], 0), max(high[1] - bottom, 0), max(left - low[0], 0), max(high[0] - right, 0))
    if not any(sides):
        return inside
    return np.asarray(cv2.copyMakeBorder(inside, *sides, cv2.BORDER_REPLICATE), dtype=np.float32)


def grid_about(centre: float, *, n_cells: int, cell_px: ArrayLike) -> Floats:
    """Return the cell centres (n, n_cells) of even grids about `centre`, for each size of `cell_px` (n,).

    >>> grid_about(10.0, n_cells=3, cell_px=[1.0, 2.0]).tolist()
    [[9.0, 10.0, 11.0], [8.0, 10.0, 12.0]]
    """
    offsets = np.arange(n_cells) - (n_cells - 1) / 2
    return np.asarray(centre + np.multiply.outer(np.asarray(cell_px, dtype=np.float64), offsets))


def boxes_of_pair(clip: Clip, *, frame_gap: int) -> tuple[Floats, Floats]:
    """Return the boxes (4,) of reference and target.

    Raises `ValueError` for a gap outside of 1 … 5, `Unusable` for a missing or too small box.
    """
    if not 1 <= frame_gap <= TARGET:
        raise ValueError(f"The frame gap is {frame_gap}; expected 1 to {TARGET}.")
    reference, target = clip.boxes[TARGET - frame_gap], clip.boxes[TARGET]
    for name, box in (("reference", reference), ("target", target)):
        if not np.all(np.isfinite(box)):
            raise Unusable(f"no box in the {name} frame")
        if not is_usable(box, min_side_px=MIN_SIDE_PX):
            raise Unusable(f"{name} box under {MIN_SIDE_PX:.0f} px")
    return reference, target


def require_centre_inside(image: Image, box: Floats, *, name: str) -> None:
    """Raise `Unusable` if the box's centre is outside the image: most of it would be border."""
    height, width = image.shape[:2]
    x, y = centre_of(box)
    if not (0 <= x <= width and 0 <= y <= height):
        raise Unusable(f"{name} box outside the image")


def cells_of(box: Floats, *, max_cells: int = MAX_CELLS) -> NDArray[np.int_]:
    """Return columns and rows (2,) of a box's patch: a cell per pixel, at most `max_cells` a side.

    >>> cells_of(np.array([0.0, 0, 48, 40])).tolist(), cells_of(np.array([0.0, 0, 128, 96])).tolist()
    ([48, 40], [64, 48])
    """
    width, height = size_of(box).tolist()
    return fewer_cells((height, width), max_cells=max_cells)


def fewer_cells(shape: tuple[float, ...], *, max_cells: int) -> NDArray[np.int_]:
    """Return columns and rows (2,) for `shape` (rows, columns), fewer if the longer side has too many."""
    cell = max(1.0, max(shape) / max_cells)
    return np.array([max(2, round(shape[1] / cell)), max(2, round(shape[0] / cell))])


def is_flat(patch: Pixels) -> bool:
    contrast = float(cv2.meanStdDev(patch)[1][0, 0])
    return not math.isfinite(contrast) or contrast < MIN_CONTRAST
