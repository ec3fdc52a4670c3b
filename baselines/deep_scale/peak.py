"""The estimate from the peak of the similarity: features compared at finer scale ratios and shifts.

The network's head knows 20 scale ratios, 4.5 % apart, and shifts by whole cells. Its features know more: here
they are compared at scale ratios 1 % apart and at shifts by quarters of a cell, and a parabola through the
five similarities about the greatest gives the scale ratio. Nothing of it is trained.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from baselines.boxes import expand, size_of
from baselines.deep_scale.crops import CropPair
from baselines.deep_scale.layers import LEAST_NORM
from baselines.deep_scale.network import MAX_SHIFT, Similarity
from baselines.deep_scale.roi_align import sampling_matrix

Floats = NDArray[np.float64]
Features = NDArray[np.float32]

STEP: Final = 0.01
"""Between two values of ln α."""

NEAR: Final = 0.2
"""The search goes so far from the head's estimate, in ln α."""

SHIFTS: Final = np.linspace(-MAX_SHIFT, MAX_SHIFT, 8 * MAX_SHIFT + 1)
"""In cells, as the head's, but by quarters."""

_REACH: Final = 2
"""Similarities on each side of the greatest that the parabola goes through."""


def peak_scale_ratio(
    pair: CropPair,
    features: tuple[Features, Features],
    *,
    near: float,
    limits: tuple[float, float],
    n_cells: int,
    similarity: Similarity,
) -> float:
    """α at which the features (24, h, w) of target and reference are most alike, near the head's estimate.

    `limits` are the least and the greatest scale ratio that the crops have room for.
    """
    low, high = np.log(limits)
    exponents = np.log(near) + STEP * np.arange(-round(NEAR / STEP), round(NEAR / STEP) + 1)
    exponents = exponents[(exponents >= low) & (exponents <= high)]
    found = similarities(
        pair, features, scales=np.exp(exponents), n_cells=n_cells, similarity=similarity
    ).max(axis=1)
    return float(np.exp(top_of(exponents, found)))


def similarities(
    pair: CropPair,
    features: tuple[Features, Features],
    *,
    scales: Floats,
    n_cells: int,
    similarity: Similarity,
) -> Floats:
    """(n, 81): how alike the features of the target are to those of the reference at each scale and shift."""
    target, reference = features
    channels, height, width = target.shape
    cells = size_of(pair.target.box) / n_cells
    columns, rows = (
        np.concatenate(
            [
                sampling_matrix(low + shift, high + shift, n_cells=n_cells, length=length)
                for shift in SHIFTS * cell
            ]
        ).astype(np.float32)
        for low, high, cell, length in zip(
            pair.target.box[:2], pair.target.box[2:], cells, (width, height), strict=True
        )
    )
    seen = rows @ (target @ columns.T)
    boxes = expand(pair.reference.box, scales)
    across, down = (
        np.stack(
            [sampling_matrix(box[axis], box[axis + 2], n_cells=n_cells, length=length) for box in boxes]
        ).astype(np.float32)
        for axis, length in ((0, reference.shape[2]), (1, reference.shape[1]))
    )
    sampled = reference @ across.reshape(-1, across.shape[2]).T
    sampled = sampled.reshape(channels, -1, len(scales), n_cells).transpose(2, 0, 1, 3)
    sampled = down[:, np.newaxis] @ sampled
    if similarity == "cosine":
        seen, sampled = _unit(seen, axis=0), _unit(sampled, axis=1)
    n = len(SHIFTS)
    seen = seen.reshape(channels, n, n_cells, n, n_cells).transpose(1, 3, 0, 2, 4).reshape(n * n, -1)
    return np.asarray(sampled.reshape(len(scales), -1) @ seen.T, dtype=np.float64) / n_cells**2


def _unit(vectors: Features, *, axis: int) -> Features:
    norms = np.sqrt(np.square(vectors).sum(axis=axis, keepdims=True) + np.float32(LEAST_NORM))
    return np.asarray(vectors / norms)


def top_of(places: Floats, values: Floats) -> float:
    """Where a parabola through the values about the greatest has its top; `places` (n,) are evenly spaced.

    The top is at most one step from the greatest value. Near an end, where the five values do not exist, it
    is the place of the greatest itself.

    >>> x = np.arange(7.0)
    >>> round(top_of(x, -((x - 3.25) ** 2)), 6)
    3.25
    """
    best = int(np.argmax(values))
    if not _REACH <= best < len(values) - _REACH:
        return float(places[best])
    offsets = np.arange(-_REACH, _REACH + 1)
    slope, curvature = np.polynomial.polynomial.polyfit(
        offsets, values[best - _REACH : best + _REACH + 1], deg=2
    )[1:]
    step = np.clip(-slope / (2 * curvature), -1, 1) if curvature < 0 else 0.0
    return float(places[best] + step * (places[1] - places[0]))
