"""Pixel MSE as the paper words it, one cut box after the other: slow, and plain enough to be believed."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from tsttc_baselines import patches, pixel_mse_toolkit
from tsttc_baselines.boxes import box_around, centre_of, size_of
from tsttc_baselines.clips import Image

Floats = NDArray[np.float64]


def cut_and_resize(window: patches.Window, box: Floats, *, columns: int, rows: int) -> NDArray[np.float32]:
    """The part of the frame under `box`, resampled to columns × rows cells."""
    x1, y1, x2, y2 = box
    x = x1 + (np.arange(columns) + 0.5) * (x2 - x1) / columns
    y = y1 + (np.arange(rows) + 0.5) * (y2 - y1) / rows
    map_x, map_y = np.meshgrid(
        ((x - window.origin[0]) / window.pixel_size[0] - 0.5).astype(np.float32),
        ((y - window.origin[1]) / window.pixel_size[1] - 0.5).astype(np.float32),
    )
    resampled = cv2.remap(window.pixels, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(resampled, dtype=np.float32)


def mean_square(differences: NDArray[np.float32]) -> float:
    """The mean of the squares."""
    return float(np.vdot(differences, differences)) / differences.size


def errors_one_by_one(
    reference: Image,
    target: Image,
    *,
    reference_box: Floats,
    target_box: Floats,
    scales: Floats,
    max_shift: int,
) -> Floats:
    """(n, 2c + 1, 2c + 1): the mean squared error of each scale at each shift, y before x."""
    size = size_of(target_box)
    columns, rows = (int(n) for n in patches.cells_of(target_box))
    cell = size / (columns, rows)
    shrink = max(1.0, float(np.max(cell)))
    target_window = patches.cut(target, centre=centre_of(target_box), size=size, pixel_size=shrink)
    reference_window = patches.cut(
        reference,
        centre=centre_of(reference_box),
        size=(size + 2 * max_shift * cell) * np.max(scales),
        pixel_size=shrink,
    )
    goal = cut_and_resize(target_window, target_box, columns=columns, rows=rows)
    shifts = range(-max_shift, max_shift + 1)
    errors = np.empty((len(scales), len(shifts), len(shifts)))
    for i, scale in enumerate(scales):
        for j, dy in enumerate(shifts):
            for k, dx in enumerate(shifts):
                centre = centre_of(reference_box) + scale * cell * (dx, dy)
                box = box_around(centre, scale * size)
                patch = cut_and_resize(reference_window, box, columns=columns, rows=rows)
                errors[i, j, k] = mean_square(patch - goal)
    return errors


def toolkit_errors_one_by_one(crops: pixel_mse_toolkit.Crops, scales: Floats) -> Floats:
    """(n, 2c + 1, 2c + 1): as the toolkit compares, one patch after the other."""
    n_shifts = 2 * crops.margin + 1
    width, height = crops.patch
    errors = np.empty((len(scales), n_shifts, n_shifts))
    for i, scale in enumerate(scales):
        patch = crops.resampled(scale)
        x, y = crops.starts(scale)
        for dy in range(n_shifts):
            for dx in range(n_shifts):
                part = crops.reference[:, y + dy : y + dy + height, x + dx : x + dx + width]
                errors[i, dy, dx] = mean_square(part - patch)
    return errors
