"""Time to contact and scale ratio: conversions between them.

τ is in seconds from the target (last) frame. The scale ratio α is the object's size in the reference frame
over its size in the target frame, at the pair rate f = 10 Hz / frame gap; α < 1 approaches. All functions are
elementwise in float64, for scalars and arrays.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evaluator.arrays import as_floats

Floats = NDArray[np.float64]

FRAME_RATE_HZ: Final = 10.0
N_FRAMES: Final = 6
"""Frames of a sequence, so that the frame gap of a pair is 1 … 5."""


def fps_of_gap(frame_gap: ArrayLike) -> Floats:
    """Return the rate in Hz of a pair of frames `frame_gap` frames apart.

    >>> float(fps_of_gap(5))
    2.0
    """
    return FRAME_RATE_HZ / as_floats(frame_gap)


def _rate_of(fps_hz: ArrayLike | None, frame_gap: ArrayLike | None) -> Floats:
    if fps_hz is not None and frame_gap is None:
        return as_floats(fps_hz)
    if frame_gap is not None and fps_hz is None:
        return fps_of_gap(frame_gap)
    given = "both" if fps_hz is not None else "neither"
    raise TypeError(f"Expected fps_hz or frame_gap, the rate of the scale ratios; found {given}.")


def scale_ratio_to_ttc(
    scale_ratio: ArrayLike, *, fps_hz: ArrayLike | None = None, frame_gap: ArrayLike | None = None
) -> Floats:
    """Convert α > 0 to τ = 1 / (f · (1/α − 1)) in seconds; α = 1 (constant size) gives +∞.

    The rate f is `fps_hz` in Hz, or that of `frame_gap`. Raises `TypeError` for both and for neither.

    >>> float(scale_ratio_to_ttc(0.8, fps_hz=2)), float(scale_ratio_to_ttc(0.8, frame_gap=5))
    (2.0, 2.0)
    >>> float(scale_ratio_to_ttc(1.0, fps_hz=2))
    inf
    """
    alpha, rate = as_floats(scale_ratio), _rate_of(fps_hz, frame_gap)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        return np.asarray(1.0 / (rate * (1.0 / alpha - 1.0)))


def ttc_to_scale_ratio(
    ttc_s: ArrayLike, *, fps_hz: ArrayLike | None = None, frame_gap: ArrayLike | None = None
) -> Floats:
    """Convert τ in seconds to α = 1 / (1 / (f · τ) + 1), the inverse of `scale_ratio_to_ttc`; ±∞ gives 1.

    The rate f is `fps_hz` in Hz, or that of `frame_gap`. Raises `TypeError` for both and for neither.

    >>> float(ttc_to_scale_ratio(2.0, fps_hz=2))
    0.8
    """
    tau, rate = as_floats(ttc_s), _rate_of(fps_hz, frame_gap)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        return np.asarray(1.0 / (1.0 / (rate * tau) + 1.0))


def convert_rate(scale_ratio: ArrayLike, *, from_fps_hz: ArrayLike, to_fps_hz: ArrayLike) -> Floats:
    """Convert a scale ratio to another rate: α_m = 1 / ((f_n / f_m) · (1/α_n − 1) + 1).

    >>> round(float(convert_rate(0.8, from_fps_hz=2, to_fps_hz=10)), 6)
    0.952381
    """
    alpha = as_floats(scale_ratio)
    rate = as_floats(from_fps_hz) / as_floats(to_fps_hz)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        return np.asarray(1.0 / (rate * (1.0 / alpha - 1.0) + 1.0))


def scale_ratio_10hz(ttc_s: ArrayLike) -> Floats:
    """Compute MiD's α₁₀(τ) = 1 / ((1/(τ·10) + 1) + 10⁻⁶), in the toolkit's order of operations.

    Neither positive nor finite for τ in about (−0.1, 0], where MiD is undefined.

    >>> round(float(scale_ratio_10hz(2.0)), 9)
    0.952380045
    """
    tau = as_floats(ttc_s)
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        ratio = np.asarray(tau * 10.0)
        np.divide(1.0, ratio, out=ratio)
        ratio += 1.0
        ratio += 1e-6
        np.divide(1.0, ratio, out=ratio)
    return ratio


def exact_log(values: Floats) -> Floats:
    """Compute the C library's natural logarithm, as the dataset's toolkit does; NaN where undefined."""
    with np.errstate(invalid="ignore"):
        positive = values > 0
    logs = np.full(values.shape, math.nan)
    of_positive = values[positive]
    logs[positive] = np.fromiter(map(math.log, of_positive.data), dtype=np.float64, count=len(of_positive))
    return logs
