"""The velocity of a depth over past frames: a line through most of them (RANSAC), or through all."""

# The paper draws pairs at random. A window has at most ten frames, so all 45 pairs are tried: deterministic
# and faster.

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluator.metrics.scale import Floats

INLIER_M: Final = 0.15
"""A frame whose depth is at most so far from the line agrees with it. The paper does not say."""

MIN_FRAMES: Final = 3

Bools = NDArray[np.bool_]
_AT_ONCE: Final = 4096
"""Windows that are worked on together: their arrays stay in the processor's cache."""


@dataclass(frozen=True, slots=True)
class Velocities:
    """Velocities of n windows: `mps` in m/s, NaN if absent, and the frames behind it."""

    # `depth_m` is the last frame's depth: as measured for an inlier, else on the line.

    mps: Floats
    depth_m: Floats
    n_inliers: NDArray[np.int64]
    n_frames: NDArray[np.int64]


def consensus_velocity(
    time_s: Floats, depth_m: Floats, is_there: Bools, *, inlier_m: float = INLIER_M
) -> Velocities:
    """Fit the line with most inliers in each of n windows; NaN for fewer than three frames.

    Arrays are (q, n), frames in order of time; those not `is_there` are ignored.
    """
    # Candidate lines go through two frames; ties go to the earliest. The velocity is the least-squares slope
    # of the inliers.
    parts = [
        _consensus(time_s[:, part], depth_m[:, part], is_there[:, part], inlier_m)
        for part in _slices(time_s.shape[1])
    ]
    return _joined(parts)


def least_squares_velocity(time_s: Floats, depth_m: Floats, is_there: Bools) -> Velocities:
    """Fit the slope over all frames of each window; arguments as for `consensus_velocity`."""
    # For windows of three frames: two of three always agree.
    n_frames = is_there.sum(axis=0)
    mps = np.where(n_frames >= MIN_FRAMES, _slopes(time_s, depth_m, is_there), np.nan)
    return Velocities(mps, depth_m[-1], n_frames, n_frames)


def _slices(n: int) -> list[slice]:
    return [slice(first, first + _AT_ONCE) for first in range(0, max(n, 1), _AT_ONCE)]


def _consensus(time_s: Floats, depth_m: Floats, is_there: Bools, inlier_m: float) -> Velocities:
    # Frames that are not there are infinitely far from every line.
    masked = np.where(is_there, depth_m, np.inf)
    most = np.full(time_s.shape[1], -1, dtype=np.int64)
    first, second = np.zeros_like(most), np.zeros_like(most)
    with np.errstate(invalid="ignore", divide="ignore"):
        for i, j in combinations(range(len(time_s)), 2):
            n_inliers = (_distances(time_s, masked, i, j) <= inlier_m).sum(axis=0)
            better = (n_inliers > most) & is_there[i] & is_there[j]
            most[better], first[better], second[better] = n_inliers[better], i, j
        columns = np.arange(time_s.shape[1])
        chosen = (first, columns), (second, columns)
        slope = (depth_m[chosen[1]] - depth_m[chosen[0]]) / (time_s[chosen[1]] - time_s[chosen[0]])
        inliers = np.abs(masked - depth_m[chosen[0]] - slope * (time_s - time_s[chosen[0]])) <= inlier_m
    n_inliers, n_frames = inliers.sum(axis=0), is_there.sum(axis=0)
    mps = np.where(n_frames >= MIN_FRAMES, _slopes(time_s, depth_m, inliers), np.nan)
    with np.errstate(invalid="ignore", divide="ignore"):
        on_line = np.where(inliers, depth_m - mps * (time_s - time_s[-1]), 0.0).sum(axis=0) / n_inliers
    return Velocities(mps, np.where(inliers[-1], depth_m[-1], on_line), n_inliers, n_frames)


def _distances(time_s: Floats, depth_m: Floats, i: int, j: int) -> Floats:
    """Compute each frame's distance from the line through frames i and j, (q, n)."""
    slope = (depth_m[j] - depth_m[i]) / (time_s[j] - time_s[i])
    away = slope * (time_s - time_s[i])
    away -= depth_m
    away += depth_m[i]
    return np.asarray(np.abs(away, out=away))


def _slopes(time_s: Floats, depth_m: Floats, counts: Bools) -> Floats:
    n_frames = counts.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        time = np.where(counts, time_s - np.where(counts, time_s, 0).sum(axis=0) / n_frames, 0.0)
        depth = np.where(counts, depth_m - np.where(counts, depth_m, 0).sum(axis=0) / n_frames, 0.0)
        return np.asarray((time * depth).sum(axis=0) / np.square(time).sum(axis=0))


def _joined(parts: list[Velocities]) -> Velocities:
    return Velocities(
        np.concatenate([part.mps for part in parts]),
        np.concatenate([part.depth_m for part in parts]),
        np.concatenate([part.n_inliers for part in parts]),
        np.concatenate([part.n_frames for part in parts]),
    )
