"""Photometric alignment (this project's own): the scale, shift, gain and offset between two frames.

With u the position relative to the centre of the target box, T the target and R the reference frame, minimise

    sum over the box of  (R(c + α·u) - gain · T(u) - offset)²

over ln α, c, gain and offset by Gauss-Newton, inverse compositional (Baker and Matthews, IJCV 56, 2004).
"""

# The derivatives are those of the target, so the normal equations are solved once.

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from operator import attrgetter
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tsttc_baselines.boxes import centre_of, expand, scale_ratio_of_boxes, size_of
from tsttc_baselines.clips import TARGET, Box, Clip, Image
from tsttc_baselines.estimates import Estimate, Unusable
from tsttc_baselines.kernels import Kernel
from tsttc_baselines.patches import boxes_of_pair, is_flat
from tsttc_baselines.pixel_mse import PixelMse

Floats = NDArray[np.float32]
Positions = NDArray[np.float64]

_BLUR: Final = 0.6
"""Standard deviation of the sampling kernel, in steps between samples: enough to keep aliasing away."""

_RANGE: Final = (0.4, 2.5)
"""Scale ratios outside this range are an alignment with something else."""

_N_COARSE: Final = 24
"""Samples along the longer side on the coarse grid: its blur leads to the right place from farther away."""

_LEAST_SCALE: Final = 0.5
"""Errors much smaller than this, in grey levels, are rounding: they do not lower the weight of others."""

_MIN_SAMPLES: Final = 4
_MIN_GAIN: Final = 0.05
_MAX_CONDITION: Final = 1e6

_CONVERGED: Final = 1e-5
_MAX_STEPS: Final = 20
_MAX_STEP: Final = 0.15
"""ln α changes by no more than this in a step: the derivatives hold no farther."""


@dataclass(frozen=True, slots=True)
class Alignment:
    """The baseline: `expand` times the box is aligned, with `samples` along its longer side."""

    # Both starts are aligned on a coarse grid; the better one is aligned again on the fine grid.

    expand: float = 1.0
    samples: int = 64

    def __call__(self, clip: Clip, *, frame_gap: int) -> Estimate:
        """Estimate α; the confidence is r², 0…1. See `Estimator`."""
        reference_box, target_box = boxes_of_pair(clip, frame_gap=frame_gap)
        reference, target = clip.grey(TARGET - frame_gap), clip.grey(TARGET)
        box, centre = expand(target_box, self.expand), centre_of(reference_box)
        coarse = Template.of(target, box, n_samples=min(_N_COARSE, self.samples))
        fits = [
            coarse.aligned(reference, centre=centre, scale_ratio=start)
            for start in _starts(clip, frame_gap=frame_gap)
        ]
        best = min(fits, key=attrgetter("residual"))
        fine = Template.of(target, box, n_samples=self.samples)
        fit = fine.aligned(reference, centre=best.centre, scale_ratio=best.scale_ratio, robust=True)
        if fit.residual >= 1:
            raise Unusable("alignment did not converge")
        return Estimate(fit.scale_ratio, confidence=1 - fit.residual)


def _starts(clip: Clip, *, frame_gap: int) -> Iterator[float]:
    with suppress(Unusable):
        yield PixelMse(search="coarse-to-fine")(clip, frame_gap=frame_gap).scale_ratio
    reference_box, target_box = boxes_of_pair(clip, frame_gap=frame_gap)
    yield float(scale_ratio_of_boxes(reference_box, target_box, measure="sqrt-area"))


@dataclass(frozen=True, slots=True)
class Fit:
    """An alignment's scale ratio and centre; `residual` is 1 - r², r the correlation of both patches."""

    scale_ratio: float
    centre: Positions
    residual: float


@dataclass(frozen=True, slots=True)
class Template:
    """A patch of the target frame on a grid, with the constants of every step.

    `columns` (n,), `rows` (m,) and `blur`, the standard deviation of the sampling kernel, are in pixels from
    the box's centre. `design` (5, m·n) has the derivatives by ln α, x and y, the patch and a constant, each
    of norm 1 after division by `norms` (5,).
    """

    columns: Positions
    rows: Positions
    blur: float
    design: Floats
    norms: Floats

    @classmethod
    def of(cls, frame: Image, box: Box, *, n_samples: int) -> Template:
        """Sample `frame` (grey) under `box`; raises `Unusable` for little texture."""
        step = max(1.0, float(max(size_of(box))) / n_samples)
        columns, rows = (_offsets(float(length), step) for length in size_of(box))
        x, y = centre_of(box) - 0.5
        across = Kernel.at(x + columns, blur=_BLUR * step, length=frame.shape[1])
        down = Kernel.at(y + rows, blur=_BLUR * step, length=frame.shape[0])
        pixels = frame[down.pixels, across.pixels].astype(np.float32)
        patch = np.asarray(down.weights @ pixels @ across.weights.T, dtype=np.float32)
        if is_flat(patch):
            raise Unusable("box has no texture")
        slope_x = down.weights @ pixels @ across.slopes.T
        slope_y = down.slopes @ pixels @ across.weights.T
        slope_scale = slope_x * columns.astype(np.float32) + slope_y * rows.astype(np.float32)[:, None]
        terms = [slope_scale, slope_x, slope_y, patch - patch.mean(), np.ones_like(patch)]
        design: Floats = np.stack(terms).reshape(len(terms), -1)
        norms = np.linalg.norm(design, axis=1, keepdims=True)
        if norms.min() <= 0:
            raise Unusable("box has no texture")
        design /= norms
        if np.linalg.cond(design @ design.T) > _MAX_CONDITION:
            raise Unusable("box has no texture")
        return cls(columns, rows, _BLUR * step, design, norms[:, 0])

    def seen_in(self, frame: Image, *, centre: Positions, scale_ratio: float) -> Floats:
        """Sample the patch (m·n,) in `frame` (grey) about `centre` (px), `scale_ratio` times as large."""
        x, y = centre - 0.5
        blur = self.blur * scale_ratio
        across = Kernel.at(x + scale_ratio * self.columns, blur=blur, length=frame.shape[1])
        down = Kernel.at(y + scale_ratio * self.rows, blur=blur, length=frame.shape[0])
        seen = down.weights @ frame[down.pixels, across.pixels].astype(np.float32) @ across.weights.T
        return np.asarray(seen.ravel(), dtype=np.float32)

    def aligned(self, frame: Image, *, centre: Positions, scale_ratio: float, robust: bool = False) -> Fit:
        """Align with `frame` (grey) by Gauss-Newton, from this centre and scale ratio."""
        # `robust` weights samples by the step before: lights, occluders and parts at other depths count less.
        reach = max(self.columns[-1], self.rows[-1])
        limits = _MAX_STEP * np.array([1, reach, reach])
        weights = np.ones_like(self.design[0])
        seen = self.seen_in(frame, centre=centre, scale_ratio=scale_ratio)
        for _ in range(_MAX_STEPS):
            terms = self._terms(seen, weights)
            gain = terms[3] / self.norms[3]
            if gain < _MIN_GAIN:
                return Fit(scale_ratio, centre, residual=1.0)
            growth, *shift = np.clip(terms[:3] / self.norms[:3] / gain, -limits, limits)
            scale_ratio /= 1 + float(growth)
            centre = centre - scale_ratio * np.array(shift)
            if not _RANGE[0] < scale_ratio < _RANGE[1]:
                return Fit(scale_ratio, centre, residual=1.0)
            seen = self.seen_in(frame, centre=centre, scale_ratio=scale_ratio)
            if max(abs(growth), *np.abs(shift) / reach) < _CONVERGED:
                break
            if robust:
                weights = _weights(seen - terms[3:].astype(np.float32) @ self.design[3:])
        return Fit(scale_ratio, centre, residual=_unlike(self.design[3], seen - seen.mean()))

    def _terms(self, seen: Floats, weights: Floats) -> Positions:
        weighted = self.design * weights
        normal = (weighted @ self.design.T).astype(np.float64)
        # The ridge keeps the equations solvable when hardly any sample has a weight.
        ridge = 1e-9 * np.eye(len(normal))
        return np.asarray(np.linalg.solve(normal + ridge, (weighted @ seen).astype(np.float64)))


def _weights(errors: Floats) -> Floats:
    """Compute Geman and McClure's weights (n,); twice the standard deviation gets a quarter."""
    scale = max(_LEAST_SCALE, 2 * 1.4826 * float(np.median(np.abs(errors))))
    return np.asarray(1 / (1 + np.square(errors / np.float32(scale))) ** 2)


def _offsets(length: float, step: float) -> Positions:
    n = max(_MIN_SAMPLES, round(length / step))
    return np.asarray((np.arange(n) - (n - 1) / 2) * (length / n))


def _unlike(one: Floats, other: Floats) -> float:
    """Compute 1 - r² of two patches of mean 0; 1 if r is not positive."""
    product = float(np.vdot(one, other))
    norms = float(np.vdot(one, one)) * float(np.vdot(other, other))
    return 1.0 if product <= 0 or norms <= 0 else max(0.0, 1 - product * product / norms)
