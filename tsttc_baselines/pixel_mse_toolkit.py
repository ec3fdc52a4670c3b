"""Pixel MSE as the dataset's toolkit computes it, written from a description of its behaviour.

It differs from the paper in four ways. It resamples the target frame, by the nearest pixel, and compares it
with a patch of the reference frame of fixed size. Its reference crop begins at the top left of the reference
box's surroundings but has the target's size, and its patch begins where the target's does: the centre is off
by s (1 − α)(0.769 − 0.5/α) for an object of size s, which matters for α > 1. Crops over 128 px are shrunk. A
softmax of normalised scores weighs the best bins nearly equally.
"""

# The toolkit drops sequences near the image's edge; here the border is repeated.

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from tsttc_baselines import patches
from tsttc_baselines.boxes import centre_of, size_of
from tsttc_baselines.clips import Image
from tsttc_baselines.estimates import Unusable
from tsttc_baselines.scales import Match, at_best_shifts, best_of

Floats = NDArray[np.float64]
Pixels = NDArray[np.float32]

MAX_CROP_PX: Final = 128
MAX_SCORE: Final = 10_000.0

NEARLY: Final = 1e-3
SMALLEST: Final = 1e-7
"""What errors of float32 products, of values 0 … 1, are compared by: they are true to a tenth of either."""

_GROUP_PX: Final = 6
"""Patches that begin within so many pixels of each other share one matrix product."""


@dataclass(frozen=True, slots=True)
class Crops:
    """Crops of both frames, (3, rows, columns) in 0 … 1; the reference's has `margin` more per side."""

    # `patch` (2,) is the object's columns and rows in them.

    reference: Pixels
    target: Pixels
    margin: int
    patch: NDArray[np.int_]

    def starts(self, scale: float) -> NDArray[np.int_]:
        """Return column and row (2,) where a scale's patch begins, in both crops."""
        rows, columns = self.target.shape[1:]
        return np.round((np.array([columns, rows]) - self.patch / scale) / 2).astype(int)

    def without(self, colour: Pixels) -> Crops:
        taken = colour[:, np.newaxis, np.newaxis]
        return replace(self, reference=self.reference - taken, target=self.target - taken)

    def resampled(self, scale: float) -> Pixels:
        """Resample the target's patch to the reference's size, (3, rows, columns), by the nearest pixel."""
        shape = (self.target.shape[2], self.target.shape[1])
        columns, rows = (
            np.clip(((length - n / scale) / 2 + (np.arange(n) + 0.5) / scale).astype(int), 0, length - 1)
            for length, n in zip(shape, self.patch, strict=True)
        )
        pixels: Pixels = self.target.take(rows, axis=1).take(columns, axis=2)
        return pixels


def crops_of(
    reference: Image, target: Image, *, reference_box: Floats, target_box: Floats, room: float, max_shift: int
) -> Crops:
    """Crop two colour frames; `room` is their size relative to the target box."""
    size = size_of(target_box) * room
    sides = np.maximum(2, np.round(size)).astype(int)
    shape = np.maximum(2, np.round(sides * min(1.0, MAX_CROP_PX / int(np.max(sides))))).astype(int)

    def crop(image: Image, corner: Floats) -> Pixels:
        left, top = np.floor(corner).astype(int).tolist()
        high = (left + int(sides[0]), top + int(sides[1]))
        pixels = patches.with_border(image, (left, top), high) / np.float32(255)
        shrunk = cv2.resize(pixels, (int(shape[0]), int(shape[1])), interpolation=cv2.INTER_LINEAR)
        return np.ascontiguousarray(shrunk.transpose(2, 0, 1), dtype=np.float32)

    ours = crop(reference, centre_of(reference_box) - size_of(reference_box) * room / 2)
    return Crops(
        reference=np.pad(ours, ((0, 0), (max_shift,) * 2, (max_shift,) * 2), mode="edge"),
        target=crop(target, centre_of(target_box) - size / 2),
        margin=max_shift,
        patch=np.maximum(2, np.round(shape / room)).astype(int),
    )


def search(
    reference: Image,
    target: Image,
    *,
    reference_box: Floats,
    target_box: Floats,
    scales: Floats,
    max_shift: int,
    n_top: int,
) -> Match:
    """Compare all scales and shifts of two colour frames and expanded boxes; raises `Unusable` if flat."""
    crops = crops_of(
        reference,
        target,
        reference_box=reference_box,
        target_box=target_box,
        room=1.0 / float(np.min(scales)),
        max_shift=max_shift,
    )
    contrast = float(np.var(crops.resampled(1.0), axis=(1, 2)).mean())
    if contrast * 255**2 < patches.MIN_CONTRAST**2:
        raise Unusable("box without texture")
    least, shifts = at_best_shifts(errors_of(crops, scales))
    settle_ties(crops, scales, least, shifts, n_top=n_top)
    return Match(
        scales=scales,
        errors=least * 255**2,
        shifts=shifts,
        scale_ratio=_softmax_mean(scales, least, n_top),
        confidence=1.0 - float(np.min(least)) / contrast,
    )


def errors_of(crops: Crops, scales: Floats) -> Floats:
    """Compute errors (n, 2c + 1, 2c + 1) of scales at shifts, y before x, of values 0 … 1."""
    # Scales whose patches begin near each other share one matrix product: all shifts of their part of the
    # reference, times the patches with zeros around.
    n_shifts = 2 * crops.margin + 1
    errors = np.empty((len(scales), n_shifts, n_shifts))
    starts = np.array([crops.starts(scale) for scale in scales])
    centred = crops.without(np.mean(crops.target, axis=(1, 2)))  # the three terms of the error are then small
    for group in _groups(starts):
        low = starts[group].min(axis=0)
        offsets = starts[group] - low
        columns, rows = low + offsets.max(axis=0) + crops.patch + n_shifts - 1
        part = centred.reference[:, low[1] : rows, low[0] : columns]
        errors[group] = _errors_of_group(part, centred, scales[group], offsets)
    return np.maximum(errors, 0.0)


def settle_ties(crops: Crops, scales: Floats, least: Floats, shifts: NDArray[np.int_], *, n_top: int) -> None:
    """Recompute in float64 those of `least` (n,), at `shifts` (n, 2), that nearly equal the best."""
    # By the nearest pixel, neighbouring scales often have the same patch and error. Products in float32 would
    # round them apart, on each processor in its own way.
    bound = float(np.sort(least)[min(n_top, len(least)) - 1])
    for index in np.flatnonzero(least <= bound * (1 + NEARLY) + SMALLEST):
        scale = float(scales[index])
        left, top = crops.starts(scale) + shifts[index] + crops.margin
        columns, rows = crops.patch
        part = crops.reference[:, top : top + rows, left : left + columns]
        difference = np.subtract(part, crops.resampled(scale), dtype=np.float64)
        least[index] = np.mean(np.square(difference))


def _errors_of_group(part: Pixels, crops: Crops, scales: Floats, offsets: NDArray[np.int_]) -> Floats:
    """Compute `errors_of` for patches that begin at `offsets` (n, 2) of `part`."""
    n_shifts = 2 * crops.margin + 1
    width, height = crops.patch
    placed = np.zeros((len(scales), *part.shape), dtype=np.float32)
    for patch, scale, (x, y) in zip(placed, scales, offsets, strict=True):
        patch[:, y : y + height, x : x + width] = crops.resampled(scale)
    flat_patches = placed.reshape(len(scales), -1)
    # Written row after row, a shift by (dx, dy) is one by dx + dy · row length: copies for dx, views for dy.
    row_length, length = part.shape[2], flat_patches.shape[1]
    pixels = np.pad(part.ravel(), (0, n_shifts * row_length))
    across = np.stack([pixels[dx : dx + length + 2 * crops.margin * row_length] for dx in range(n_shifts)])
    products = np.empty((len(scales), n_shifts, n_shifts))
    for dy in range(n_shifts):
        products[:, dy] = flat_patches @ across[:, dy * row_length : dy * row_length + length].T
    own = np.einsum("nk,nk->n", flat_patches, flat_patches, dtype=np.float64)
    energies = _energies(part, offsets, width=int(width), height=int(height), n_shifts=n_shifts)
    return np.asarray((energies - 2.0 * products + own[:, np.newaxis, np.newaxis]) / (3 * width * height))


def _energies(part: Pixels, offsets: NDArray[np.int_], *, width: int, height: int, n_shifts: int) -> Floats:
    """Sum the squares of `part` under each patch at each shift, (n, n_shifts, n_shifts)."""
    squares = np.sum(np.square(part, dtype=np.float64), axis=0)
    sums = np.pad(squares.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    shifts = np.arange(n_shifts)
    x = (offsets[:, :1] + shifts)[:, np.newaxis, :]
    y = (offsets[:, 1:] + shifts)[:, :, np.newaxis]
    return np.asarray(sums[y + height, x + width] - sums[y, x + width] - sums[y + height, x] + sums[y, x])


def _groups(starts: NDArray[np.int_]) -> Iterator[slice]:
    """Group consecutive scales whose patches begin within `_GROUP_PX`."""
    first = 0
    for index in range(1, len(starts) + 1):
        if index == len(starts) or np.max(np.abs(starts[index] - starts[first])) > _GROUP_PX:
            yield slice(first, index)
            first = index


def _softmax_mean(scales: Floats, errors: Floats, n_top: int) -> float:
    """Compute the toolkit's α̂: the softmax of scores 1 / MSE / 255, at most 10,000, divided by the best."""
    # Of the `n_top` best scores, and all that equal the best.
    with np.errstate(divide="ignore"):
        scores = np.minimum(1.0 / errors / 255.0, MAX_SCORE)
    chosen = np.union1d(best_of(-scores, n_top=n_top), np.flatnonzero(scores == scores.max()))
    weights = np.exp(scores[chosen] / scores.max())
    return float(np.dot(scales[chosen], weights) / np.sum(weights))
