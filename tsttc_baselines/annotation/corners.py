"""The nearest corner of a 3D box, whose depth the ground truth follows (paper, Eq. 2)."""

from __future__ import annotations

from typing import Final

import numpy as np

from evaluator.metrics.scale import Floats

_SIGNS: Final = np.array([(i, j, k) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], dtype=np.float64)


def corners_m(centre_m: Floats, size_m: Floats, yaw_rad: Floats) -> Floats:
    """Compute the corners (n, 8, 3) of boxes from centres (n, 3), sizes (n, 3) and yaws (n,).

    Axes: x right, y forward, z up. Size: length, width, height; at yaw 0 the length is along x, and the yaw
    turns x towards y.

    >>> boxes = np.array([[0.0, 10.0, 0.0]]), np.array([[4.0, 2.0, 1.5]]), np.array([np.pi / 2])
    >>> [round(float(y), 6) for y in sorted(set(corners_m(*boxes)[0, :, 1].round(6)))]
    [8.0, 12.0]
    """
    offsets = _SIGNS[np.newaxis] * (size_m / 2)[:, np.newaxis]
    cosine, sine = np.cos(yaw_rad)[:, np.newaxis], np.sin(yaw_rad)[:, np.newaxis]
    turned = np.stack(
        [
            cosine * offsets[..., 0] - sine * offsets[..., 1],
            sine * offsets[..., 0] + cosine * offsets[..., 1],
            offsets[..., 2],
        ],
        axis=-1,
    )
    return np.asarray(centre_m[:, np.newaxis] + turned)


def nearest_depth_m(centre_m: Floats, size_m: Floats, yaw_rad: Floats) -> Floats:
    """Compute y of the corner nearest to the origin, (n,); arguments as for `corners_m`."""
    corners = corners_m(centre_m, size_m, yaw_rad)
    nearest = np.argmin(np.square(corners).sum(axis=-1), axis=1)
    return np.asarray(corners[np.arange(len(corners)), nearest, 1])
