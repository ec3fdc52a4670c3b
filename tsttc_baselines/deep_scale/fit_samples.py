"""Training samples of the fit (`fit`): two crops of a pair on one grid, and how far they are apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tsttc_baselines.boxes import centre_of
from tsttc_baselines.clips import Image
from tsttc_baselines.deep_scale.fit import COARSE_PX, FINE_PX, Grid, View, shown_at
from tsttc_baselines.deep_scale.network import Operations

Floats = NDArray[np.float64]
Pixels = NDArray[np.float32]

_SHARE_COARSE: Final = 0.2
"""Of the pairs; the others have between `_LEAST_FINE` of the fine grid's size and all of it."""

_LEAST_FINE: Final = 0.7

_SHARE_NEAR: Final = 0.7
_NEAR: Final = (0.004, 0.25)
_FAR: Final = (0.02, 1.0)
"""Standard deviations of what a pair lacks: in ln α, and of the shift in pixels of the grid. Most pairs are
near, as in the last steps of a fit.
"""


@dataclass(frozen=True, slots=True, eq=False)
class FitSample:
    """Pixels (2, 3, rows, columns) of target and reference; `lacking` is missing in the reference's ln α."""

    pixels: Pixels
    grid: Grid
    lacking: float


def fit_sample(
    frames: tuple[Image, Image],
    boxes: tuple[Floats, Floats],
    *,
    scale_ratio: float,
    operations: Operations,
    rng: np.random.Generator,
) -> FitSample:
    """Cut the reference where it shows the target's vehicle, with a small error in ln α and position."""
    # The position is where the network sees the vehicle, because each box errs for itself.
    reference, target = frames
    reference_box, box = boxes
    there = shown_at(operations, frames, box, View(scale_ratio, centre_of(reference_box)))
    is_coarse = rng.random() < _SHARE_COARSE
    grid = Grid.over(box, box_px=COARSE_PX if is_coarse else FINE_PX * _LEAST_FINE ** rng.random())
    growth_sd, shift_sd = _NEAR if rng.random() < _SHARE_NEAR else _FAR
    error = growth_sd * rng.normal()
    shift = shift_sd * rng.normal(size=2) * grid.pixel_size * scale_ratio
    start = View(scale_ratio * float(np.exp(error)), there.centre + shift)
    cuts = (grid.cut(target, View(1.0, centre_of(box))), grid.cut(reference, start))
    return FitSample(np.stack(cuts), grid, -error)
