"""Scale bins: which scale ratios are tried for a frame gap, and the mean over the best of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SCALE_RANGES: Final[dict[int, tuple[float, float]]] = {
    1: (0.90, 1.08),
    2: (0.80, 1.20),
    3: (0.75, 1.25),
    4: (0.70, 1.40),
    5: (0.65, 1.50),
}
"""Least and greatest α by frame gap, the toolkit's. At gap 5 (2 Hz) nothing between τ = −1.5 s and 0.93 s can
be said: a nearer object changes its size by more.
"""

N_BINS: Final = 125
N_TOP: Final = 3

MIN_MSE: Final = 1e-6
"""A mean squared error below this, in squared grey levels, counts as this: weights stay finite."""


def scale_bins(*, frame_gap: int, n_bins: int = N_BINS) -> Floats:
    """Return the scale ratios to try (n_bins,), ascending, evenly spaced for the frame gap.

    Raises `ValueError` for a gap outside of 1 … 5 and for fewer than two bins.

    >>> scale_bins(frame_gap=5, n_bins=3).tolist()
    [0.65, 1.075, 1.5]
    """
    if frame_gap not in SCALE_RANGES:
        raise ValueError(f"The frame gap is {frame_gap}; expected 1 to {max(SCALE_RANGES)}.")
    if n_bins < 2:
        raise ValueError(f"There are {n_bins} scale bins; expected at least 2.")
    return np.linspace(*SCALE_RANGES[frame_gap], n_bins)


def best_of(errors: Floats, *, n_top: int) -> NDArray[np.intp]:
    """Return the indices (≤ n_top,) of the smallest errors, best first."""
    return np.argsort(errors, kind="stable")[:n_top]


def at_best_shifts(errors: Floats) -> tuple[Floats, NDArray[np.int_]]:
    """Return each scale's least error (n,) and its shift (n, 2), x and y from −c to c.

    `errors` is (n, 2c + 1, 2c + 1), y before x.

    >>> least, shifts = at_best_shifts(np.array([[[3.0, 3, 3], [3, 3, 1], [3, 3, 3]]]))
    >>> least.tolist(), shifts.tolist()
    ([1.0], [[1, 0]])
    """
    n_shifts = errors.shape[2]
    flat = errors.reshape(len(errors), -1)
    indices = np.argmin(flat, axis=1)
    shifts = np.stack([indices % n_shifts, indices // n_shifts], axis=1) - n_shifts // 2
    return flat[np.arange(len(errors)), indices], shifts


def weighted_scale_ratio(scales: Floats, errors: Floats) -> float:
    """Compute α̂ = Σ wᵢ αᵢ, wᵢ = (1/MSEᵢ) / Σ (1/MSE), the paper's mean over the best bins (§5.3).

    >>> round(weighted_scale_ratio(np.array([0.8, 0.9]), np.array([1.0, 3.0])), 3)
    0.825
    """
    weights = 1.0 / np.maximum(errors, MIN_MSE)
    return float(np.dot(scales, weights) / np.sum(weights))


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """The matches of a search over scale bins.

    `scales` (n,) ascending, `errors` (n,) their least mean squared errors in grey levels², `shifts` (n, 2) in
    cells, x and y. `scale_ratio` is the estimate, `confidence` the explained part of the patch's variance, at
    most 1.
    """

    scales: Floats
    errors: Floats
    shifts: NDArray[np.int_]
    scale_ratio: float
    confidence: float
