"""Sampling of an axis of a frame between its pixels: a Gaussian about each position."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Positions = NDArray[np.float64]

_REACH: Final = 3.0
"""The kernel is cut off here, in standard deviations."""


@dataclass(frozen=True, slots=True)
class Kernel:
    """The Gaussian sampling of one axis: `weights` (n, k) times the slice `pixels` (k,) gives samples."""

    # Cut off at the frame's ends. `slopes` gives the derivatives by position.

    pixels: slice
    weights: Floats
    slopes: Floats

    @classmethod
    def at(cls, positions: Positions, *, blur: float, length: int) -> Kernel:
        """Make the kernel for ascending `positions` (n,) in an axis of `length` pixels; edges repeat."""
        inside = np.clip(positions, 0, length - 1)
        first = max(0, int(inside[0] - _REACH * blur))
        last = min(length, int(inside[-1] + _REACH * blur) + 2)
        distance = ((np.arange(first, last) - inside[:, None]) / blur).astype(np.float32)
        weights = np.exp(-0.5 * distance * distance)
        weights /= weights.sum(axis=1, keepdims=True)
        return cls(slice(first, last), weights, weights * distance / np.float32(blur))
