"""Boxes: centre and size, expansion within the image, and the scale ratio of two boxes.

Functions take one box (4,) or many (…, 4): x1, y1, x2, y2 in pixels, the left edge of the first pixel at 0.
"""

from __future__ import annotations

from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

Measure = Literal["area", "sqrt-area", "height", "width"]
"""What of a box is compared with the other: "area" is what the paper's Detection and SOT take for a size."""

MEASURES: Final[tuple[Measure, ...]] = get_args(Measure)

MAX_EXPANSION: Final = 1.1
"""Paper §6.1: boxes are enlarged by this ratio "if the expanded boxes do not exceed the image boundary"."""


def centre_of(boxes: ArrayLike) -> Floats:
    """Return the centres (…, 2), x and y in pixels.

    >>> centre_of([10, 20, 30, 50]).tolist()
    [20.0, 35.0]
    """
    corners = np.asarray(boxes, dtype=np.float64)
    return np.asarray((corners[..., :2] + corners[..., 2:]) / 2)


def size_of(boxes: ArrayLike) -> Floats:
    """Return widths and heights (…, 2) in pixels.

    >>> size_of([10, 20, 30, 50]).tolist()
    [20.0, 30.0]
    """
    corners = np.asarray(boxes, dtype=np.float64)
    return np.asarray(corners[..., 2:] - corners[..., :2])


def box_around(centre: ArrayLike, size: ArrayLike) -> Floats:
    """Make boxes (…, 4) from centres and sizes.

    >>> box_around([20, 35], [20, 30]).tolist()
    [10.0, 20.0, 30.0, 50.0]
    """
    middle, half = np.asarray(centre, dtype=np.float64), np.asarray(size, dtype=np.float64) / 2
    return np.concatenate([middle - half, middle + half], axis=-1)


def expand(boxes: ArrayLike, ratio: ArrayLike) -> Floats:
    """Return `boxes`, an array of shape (…, 4), enlarged `ratio` times about their centres.

    >>> expand([10, 20, 30, 50], 2).tolist()
    [0.0, 5.0, 40.0, 65.0]
    """
    factor = np.asarray(ratio, dtype=np.float64)[..., np.newaxis]
    return box_around(centre_of(boxes), size_of(boxes) * factor)


def room_in_image(box: ArrayLike, *, width_px: float, height_px: float) -> float:
    """Return the greatest ratio by which `box` fits the image when expanded; below 1 if it leaves it.

    >>> room_in_image([10, 20, 30, 50], width_px=100, height_px=100)
    2.0
    """
    image = np.array([width_px, height_px], dtype=np.float64)
    centre = centre_of(box)
    return float(np.min(2 * np.minimum(centre, image - centre) / size_of(box)))


def shared_expansion(
    reference: ArrayLike,
    target: ArrayLike,
    *,
    width_px: float,
    height_px: float,
    at_most: float = MAX_EXPANSION,
) -> float:
    """Return the ratio by which both boxes can be expanded within the image, at most `at_most`.

    A box at the image's edge keeps its size; `at_most` below 1 is kept.

    >>> shared_expansion([10, 20, 30, 50], [1, 20, 25, 50], width_px=100, height_px=100)
    1.0833333333333333
    """
    rooms = (room_in_image(box, width_px=width_px, height_px=height_px) for box in (reference, target))
    return min(at_most, max(1.0, min(rooms)))


def scale_ratio_of_boxes(reference: ArrayLike, target: ArrayLike, *, measure: Measure) -> Floats:
    """Return the scale ratios α of pairs of boxes: the size in the reference divided by that in the target.

    - `reference`, `target`: boxes, arrays of shape (…, 4).
    - `measure`: what counts as the size: "area", "sqrt-area", "height" or "width". The paper's Detection
      takes the area (§6.1); the square root of the area is correct.

    The result has the shape (…,). Boxes without size give NaN or infinity.

    >>> float(scale_ratio_of_boxes([0, 0, 8, 8], [0, 0, 10, 10], measure="height"))
    0.8
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = size_of(reference) / size_of(target)
        if measure == "width":
            return np.asarray(ratios[..., 0])
        if measure == "height":
            return np.asarray(ratios[..., 1])
        areas = ratios[..., 0] * ratios[..., 1]
        return np.asarray(areas if measure == "area" else np.sqrt(areas))


def is_usable(box: ArrayLike, *, min_side_px: float = 0.0) -> bool:
    """Return whether all four numbers of `box` are finite, and both sides longer than `min_side_px`.

    >>> is_usable([10, 20, 30, 50])
    True
    >>> is_usable([30, 20, 10, 50])
    False
    """
    return bool(np.all(np.isfinite(np.asarray(box, dtype=np.float64))) and np.all(size_of(box) > min_side_px))
