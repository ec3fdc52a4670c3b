"""Pixel MSE as the dataset's toolkit computes it, written from a description of its behaviour.

It differs from the paper in four ways that show in the numbers. It resamples the target frame, by the nearest
pixel, and compares it with a patch of the reference frame that keeps its size. Its crop of the reference
frame begins at the top left corner of the reference box's own surroundings but has the target's size, and its
patch begins where the target's does: its centre is off by s (1 − α)(0.769 − 0.5/α) for an object of size s,
which matters for α > 1. Crops over 128 px are shrunk. The weights of the best bins are a softmax of
normalised scores, which is nearly their plain mean.

One difference is ours: the toolkit drops sequences near the edge of the image; here the border is repeated.
"""

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
    """What is compared: crops of both frames, (3, rows, columns) in 0 … 1, of one shape, the reference's with
    `margin` further pixels on every side; `patch` (2,) is the object's columns and rows in them.
    """

    reference: Pixels
    target: Pixels
    margin: int
    patch: NDArray[np.int_]

    def starts(self, scale: float) -> NDArray[np.int_]:
        """(2,): column and row where the patch of a scale begins, in both crops."""
        rows, columns = self.target.shape[1:]
        return np.round((np.array([columns, rows]) - self.patch / scale) / 2).astype(int)

    def without(self, colour: Pixels) -> Crops:
        """The same crops with this colour (3,) taken off every pixel."""
        taken = colour[:, np.newaxis, np.newaxis]
        return replace(self, reference=self.reference - taken, target=self.target - taken)

    def resampled(self, scale: float) -> Pixels:
        """(3, rows, columns): the target's patch at the reference's size, by the nearest pixel."""
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
    """The crops of two colour frames; `room` is how many times larger they are than the target box."""
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
    """All scales at all shifts of two colour frames, boxes expanded already; `Unusable` without texture."""
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
    """(n, 2c + 1, 2c + 1): the mean squared error of each scale at each shift, y before x, of values 0 … 1.

    Scales whose patches begin near each other are compared in one matrix product: all shifts of the part of
    the reference that they cover, times their patches, each at its place in that part with zeros around it.
    """
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
    """Compute in float64 those of `least` (n,), at `shifts` (n, 2), that are nearly as small as the best.

    By the nearest pixel, neighbouring scales often give the same patch and so the same error. Products in
    float32 round them apart, on each processor in its own way, and so choose other bins.
    """
    bound = float(np.sort(least)[min(n_top, len(least)) - 1])
    for index in np.flatnonzero(least <= bound * (1 + NEARLY) + SMALLEST):
        scale = float(scales[index])
        left, top = crops.starts(scale) + shifts[index] + crops.margin
        columns, rows = crops.patch
        part = crops.reference[:, top : top + rows, left : left + columns]
        difference = np.subtract(part, crops.resampled(scale), dtype=np.float64)
        least[index] = np.mean(np.square(difference))


def _errors_of_group(part: Pixels, crops: Crops, scales: Floats, offsets: NDArray[np.int_]) -> Floats:
    """(n, 2c + 1, 2c + 1): as `errors_of`, for patches that begin at `offsets` (n, 2) of `part`."""
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
    """(n, n_shifts, n_shifts): the sum of squares of `part` under each patch at each shift."""
    squares = np.sum(np.square(part, dtype=np.float64), axis=0)
    sums = np.pad(squares.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    shifts = np.arange(n_shifts)
    x = (offsets[:, :1] + shifts)[:, np.newaxis, :]
    y = (offsets[:, 1:] + shifts)[:, :, np.newaxis]
    return np.asarray(sums[y + height, x + width] - sums[y, x + width] - sums[y + height, x] + sums[y, x])


def _groups(starts: NDArray[np.int_]) -> Iterator[slice]:
    """Runs of consecutive scales whose patches begin within `_GROUP_PX` of each other."""
    first = 0
    for index in range(1, len(starts) + 1):
        if index == len(starts) or np.max(np.abs(starts[index] - starts[first])) > _GROUP_PX:
            yield slice(first, index)
            first = index


def _softmax_mean(scales: Floats, errors: Floats, n_top: int) -> float:
    """α̂ of the toolkit: scores are 1 / MSE / 255, at most 10,000; the `n_top` best and all equal to the best,
    divided by the best, weigh as their softmax.
    """
    with np.errstate(divide="ignore"):
        scores = np.minimum(1.0 / errors / 255.0, MAX_SCORE)
    chosen = np.union1d(best_of(-scores, n_top=n_top), np.flatnonzero(scores == scores.max()))
    weights = np.exp(scores[chosen] / scores.max())
    return float(np.dot(scales[chosen], weights) / np.sum(weights))
