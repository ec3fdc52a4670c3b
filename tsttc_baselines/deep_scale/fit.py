"""The estimate from a fit: the reference frame is cut again until its features match the target's.

The head knows 20 scale ratios, 4.5 % apart, and whole cells; here scale ratio and shift are continuous. The
target's box and the reference, moved and scaled by the present estimate, are cut on one grid. Their features
F give a Gauss-Newton step

    F_target(u) − F_reference(u)  ≈  (δ · u + s) · ∇F(u)

with u the position from the middle of the box and F in the gradient the mean of both (Malis, "Improving
vision-based control using efficient second-order minimization techniques", 2004). The reference is then cut
at α · exp(δ), shifted by s. Weighted least squares: features by the inverse covariance of their errors,
pixels by the step before, so that surroundings, lights and parts at other depths count less.
"""

# Both crops are computed alike, so an error that depends on where the pixels lie cancels.

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from tsttc_baselines.boxes import centre_of, size_of
from tsttc_baselines.clips import Image
from tsttc_baselines.deep_scale.layers import LEAST_NORM
from tsttc_baselines.deep_scale.network import Array, Operations, features
from tsttc_baselines.detection import scale_ratio_of_two
from tsttc_baselines.kernels import Kernel

Floats = NDArray[np.float64]
Pixels = NDArray[np.float32]

COARSE_PX: Final = 32.0
"""The longer side of the box in the first steps: there a step reaches farther, and costs less than half."""

FINE_PX: Final = 64.0
"""The longer side of the box in the last steps."""

_N_STEPS: Final = 2
"""On each of the two grids."""

_EXPANSION: Final = 1.1
"""The box is so many times as large: its edges show more than what is inside."""

_MAX_ENLARGEMENT: Final = 2.0
"""Of a frame: more shows nothing that the frame does not have."""

_MARGIN_PX: Final = 10
"""On each side of what is compared: features at the edge of a crop have seen zeros, which do not move."""

_BLUR: Final = 0.8
"""Standard deviation of the sampling kernel, in pixels of the grid, or of the frame if those are larger."""

_MAX_STEP: Final = 0.08
"""ln α changes by no more than this in a step, and the edges of the box by no more than this share."""

_STARTS: Final = (0.4, 2.5)
"""Scale ratios outside this range are those of wrong boxes."""

_N_WEIGHINGS: Final = 3
_COVARIANCE_RIDGE: Final = 0.1
"""Of the mean variance, added to each feature's: a pair shows too little to know small variances."""

_NORMAL_RIDGE: Final = 1e-6
"""Keeps the equations solvable where a box has no texture; the step is 0 there."""


@dataclass(frozen=True, slots=True)
class View:
    """The part of a frame on a grid: `scale_ratio` times its size, about `centre` (2,), in pixels."""

    scale_ratio: float
    centre: Floats


@dataclass(frozen=True, slots=True)
class Grid:
    """An even grid over the target's box and a margin; `pixel_size` is in target pixels."""

    # `shape` is (rows, columns), both even; `rows` and `columns` are those over the box.

    shape: tuple[int, int]
    rows: slice
    columns: slice
    pixel_size: float

    @classmethod
    def over(cls, box: Floats, *, box_px: float) -> Grid:
        """Make the grid for a box (4,) with a longer side of `box_px` or less."""
        # Frames are enlarged at most twice.
        size = _EXPANSION * size_of(box)
        longer = float(np.max(size))
        pixel_size = longer / min(box_px, _MAX_ENLARGEMENT * longer)
        columns, rows = (max(4, round(side / pixel_size)) for side in size.tolist())
        n_columns, n_rows = (side + side % 2 + 2 * _MARGIN_PX for side in (columns, rows))
        return cls(
            (n_rows, n_columns),
            slice((n_rows - rows) // 2, (n_rows - rows) // 2 + rows),
            slice((n_columns - columns) // 2, (n_columns - columns) // 2 + columns),
            pixel_size,
        )

    def cut(self, frame: Image, view: View) -> Pixels:
        """Cut a view of a colour frame on this grid, (3, rows, columns); the border repeats."""
        step = self.pixel_size * view.scale_ratio
        blur = _BLUR * max(self.pixel_size, 1.0) * view.scale_ratio
        down, across = (
            Kernel.at(middle - 0.5 + step * offsets, blur=blur, length=length)
            for middle, offsets, length in zip(
                view.centre[::-1].tolist(), self.offsets(), frame.shape[:2], strict=True
            )
        )
        pixels = frame[down.pixels, across.pixels].astype(np.float32).transpose(2, 0, 1)
        return np.asarray(down.weights @ pixels @ across.weights.T)

    def offsets(self) -> tuple[Floats, Floats]:
        """The rows' and columns' offsets from the middle of the box, in grid pixels."""
        rows, columns = (np.arange(length, dtype=np.float64) - (length - 1) / 2 for length in self.shape)
        return rows, columns

    @property
    def reach(self) -> float:
        """The distance from the middle of the box to its farther edge, in grid pixels."""
        return 0.5 * float(max(part.stop - part.start for part in (self.rows, self.columns)))

    def moved(self, view: View, step: Floats) -> View:
        """Move a view by a step (3,): growth of ln α, shifts in x and y in grid pixels."""
        limits = _MAX_STEP * np.array([1.0, self.reach, self.reach])
        growth, *shift = np.clip(step, -limits, limits)
        centre = view.centre + view.scale_ratio * self.pixel_size * np.array(shift)
        return View(view.scale_ratio * float(np.exp(growth)), centre)


@dataclass(frozen=True, slots=True)
class Fit:
    """A view, and the squared feature differences before the last step."""

    view: View
    unlike: float


def fitted_scale_ratio(
    operations: Operations,
    frames: tuple[Image, Image],
    boxes: tuple[Floats, Floats],
    *,
    near: float,
) -> float:
    """Estimate α of a pair of colour frames and boxes (4,) in pixels; `near` is the head's estimate."""
    # Starts are `near` and the ratio of the boxes' sizes; the better one on the coarse grid continues. Boxes
    # without a size are `Unusable`.
    starts = np.clip([near, scale_ratio_of_two(*boxes, measure="sqrt-area")], *_STARTS)
    views = [View(start, centre_of(boxes[0])) for start in starts.tolist()]
    for box_px in (COARSE_PX, FINE_PX):
        fits = _fits(operations, frames, boxes[1], views, box_px=box_px)
        views = [min(fits, key=attrgetter("unlike")).view]
    return views[0].scale_ratio


def shown_at(operations: Operations, frames: tuple[Image, Image], box: Floats, view: View) -> View:
    return _fits(operations, frames, box, [view], box_px=COARSE_PX)[0].view


def _fits(
    operations: Operations,
    frames: tuple[Image, Image],
    box: Floats,
    views: Sequence[View],
    *,
    box_px: float,
) -> list[Fit]:
    reference, target = frames
    grid = Grid.over(box, box_px=box_px)
    wanted = _features(operations, grid.cut(target, View(1.0, centre_of(box))))
    return [_approached(operations, reference, view, grid=grid, target=wanted) for view in views]


def _approached(operations: Operations, reference: Image, view: View, *, grid: Grid, target: Pixels) -> Fit:
    unlike = np.inf
    for _ in range(_N_STEPS):
        seen = _features(operations, grid.cut(reference, view))
        rows, columns = (offsets.astype(np.float32) for offsets in grid.offsets())
        design, errors = equations(np, target, seen, grid=grid, offsets=(rows, columns))
        unlike = float(np.square(errors).sum(axis=0).mean())
        metric, weights = weighting(np, design, errors)
        step = solution(np, metric @ design, metric @ errors, weights)
        view = grid.moved(view, step.astype(np.float64))
    return Fit(view, unlike)


def _features(operations: Operations, pixels: Pixels) -> Pixels:
    feature_map = features(operations, operations.constant(pixels[np.newaxis]))
    return np.asarray(evened(operations.values(feature_map)[0]))


def evened(maps: Array) -> Array:
    """Even out the strength of features (24, h, w), less where there are hardly any."""
    squares = (maps**2).sum(0)
    return maps / (squares + squares.mean() + LEAST_NORM) ** 0.5


def equations(
    xp: Any, target: Array, reference: Array, *, grid: Grid, offsets: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Return derivatives (3, 24, p) by ln α, x and y, and the reference's excess (24, p)."""
    # For the box's pixels, from features (24, h, w) of `evened`; `xp` is numpy or torch.
    rows, columns = grid.rows, grid.columns
    mean = 0.5 * (target + reference)
    slope_x = (mean[:, rows, _shifted(columns, 1)] - mean[:, rows, _shifted(columns, -1)]) / 2
    slope_y = (mean[:, _shifted(rows, 1), columns] - mean[:, _shifted(rows, -1), columns]) / 2
    growth = slope_x * offsets[1][columns] + slope_y * offsets[0][rows][:, None]
    design = xp.stack([growth, slope_x, slope_y]).reshape(3, len(mean), -1)
    errors = (reference - target)[:, rows, columns].reshape(len(mean), -1)
    return design, errors


def _shifted(part: slice, by: int) -> slice:
    return slice(part.start + by, part.stop + by)


def weighting(xp: Any, design: Array, errors: Array) -> tuple[Array, Array]:
    """Compute the weights of features (24, 24) and of pixels (p,)."""
    weights = _weights(xp, errors)
    covariance = (errors * weights) @ errors.T / weights.sum()
    ones = xp.ones_like(covariance[0])
    ridge = _COVARIANCE_RIDGE * covariance.trace() / len(covariance) + LEAST_NORM**0.5
    metric = xp.linalg.inv(xp.linalg.cholesky(covariance + xp.diag(ones * ridge)))
    design, errors = metric @ design, metric @ errors
    weights = xp.ones_like(errors[0])
    for _ in range(_N_WEIGHINGS):
        step = solution(xp, design, errors, weights)
        weights = _weights(xp, errors + (step @ design.reshape(3, -1)).reshape(errors.shape))
    return metric, weights


def solution(xp: Any, design: Array, errors: Array, weights: Array) -> Array:
    """Solve for the step (3,) by weighted least squares."""
    weighted = (design * weights).reshape(3, -1)
    design = design.reshape(3, -1)
    norms = ((weighted * design).sum(-1) + LEAST_NORM) ** 0.5
    normal = weighted @ design.T / norms / norms[:, None]
    ridge = xp.diag(xp.ones_like(norms) * _NORMAL_RIDGE)
    return xp.linalg.solve(normal + ridge, -(weighted @ errors.reshape(-1)) / norms) / norms


def _weights(xp: Any, errors: Array) -> Array:
    """Compute Geman and McClure's weights (p,); the median error gets a quarter."""
    squares = (errors**2).sum(0)
    return 1 / (1 + squares / (xp.median(squares) + LEAST_NORM)) ** 2
