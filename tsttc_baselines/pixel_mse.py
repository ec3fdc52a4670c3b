"""Pixel MSE (§5.3, §6.1): the scale at which the reference frame looks like the target box.

For each scale ratio α of the bins, a box of α times the *target's* size about the reference box's centre is
cut from the reference frame, resampled to the target's patch, and compared by mean squared error, also at
shifts of up to c cells; the best counts. α̂ is the mean of the three best bins, weighted by the reciprocals
of their errors.
"""

# With R the resampled reference and T the patch of n cells, MSE = (ΣR² − 2 ΣRT + ΣT²) / n: the middle term
# for all scales and shifts is one matrix product instead of 125 × 49 cut boxes.

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Final, Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from tsttc_baselines import patches, pixel_mse_toolkit
from tsttc_baselines.boxes import MAX_EXPANSION, centre_of, expand, shared_expansion, size_of
from tsttc_baselines.clips import TARGET, Clip, Image
from tsttc_baselines.estimates import Estimate, Unusable
from tsttc_baselines.scales import (
    N_BINS,
    N_TOP,
    Match,
    at_best_shifts,
    best_of,
    scale_bins,
    weighted_scale_ratio,
)

Floats = NDArray[np.float64]

Variant = Literal["paper", "toolkit"]

Search = Literal["full", "coarse-to-fine"]
SEARCHES: Final[tuple[Search, ...]] = get_args(Search)

MAX_SHIFT: Final = 3
"""The paper's c, in cells of the target's patch."""

COARSE_CELLS: Final = 24
COARSE_STEP: Final = 5
NEAR: Final = 8
"""The coarse search compares patches of at most so many cells, and every fifth bin; the fine search the bins
that lie at most so many from the best of these.
"""


CLOSE: Final = 0.02
"""A match whose error is less than so much of the patch's variance is computed in float64."""

_PART: Final = 1024
"""So many cells are multiplied at once."""


@dataclass(frozen=True, slots=True)
class PixelMse:
    """The paper's Pixel MSE, or the toolkit's code of that name (`pixel_mse_toolkit`).

    `bins` scale ratios; shifts up to `shift` cells; mean of the `top` best bins; boxes `expand` times as
    large, within the image. Only the paper's variant: at most `cells` cells on a patch's longer side, each at
    least a pixel; `search="coarse-to-fine"` compares coarsely, then the bins near the best one, four times as
    fast.
    """

    variant: Variant = "paper"
    bins: int = N_BINS
    shift: int = MAX_SHIFT
    top: int = N_TOP
    expand: float = MAX_EXPANSION
    cells: int = patches.MAX_CELLS
    search: Search = "full"

    def __call__(self, clip: Clip, *, frame_gap: int) -> Estimate:
        """Estimate α; raises `Unusable` for a box that is missing, too small, outside or without texture."""
        match = self.match(clip, frame_gap=frame_gap)
        return Estimate(match.scale_ratio, confidence=match.confidence)

    def match(self, clip: Clip, *, frame_gap: int) -> Match:
        """Return the errors of all bins and the estimate; raises as a call does."""
        frame = clip.colour if self.variant == "toolkit" else clip.grey
        frames = (frame(TARGET - frame_gap), frame(TARGET))
        reference_box, target_box = self.boxes(clip, frames, frame_gap=frame_gap)
        scales = scale_bins(frame_gap=frame_gap, n_bins=self.bins)
        if self.variant == "toolkit":
            return pixel_mse_toolkit.search(
                *frames,
                reference_box=reference_box,
                target_box=target_box,
                scales=scales,
                max_shift=self.shift,
                n_top=self.top,
            )
        comparison = Comparison.of(
            *frames,
            reference_box=reference_box,
            target_box=target_box,
            max_scale=float(scales[-1]),
            max_shift=self.shift,
            max_cells=self.cells,
        )
        if self.search == "coarse-to-fine":
            scales = near_the_best(comparison, scales, max_shift=self.shift)
        errors = comparison.errors(scales, max_shift=self.shift)
        return _match(comparison, scales, errors, n_top=self.top)

    def boxes(self, clip: Clip, frames: tuple[Image, Image], *, frame_gap: int) -> tuple[Floats, Floats]:
        """Return both expanded boxes in these frames; raises as a call does."""
        boxes = patches.boxes_of_pair(clip, frame_gap=frame_gap)
        for image, box, name in zip(frames, boxes, ("reference", "target"), strict=True):
            patches.require_centre_inside(image, box, name=name)
        height, width = frames[1].shape[:2]
        ratio = shared_expansion(*boxes, width_px=width, height_px=height, at_most=self.expand)
        return expand(boxes[0], ratio), expand(boxes[1], ratio)


@dataclass(frozen=True, slots=True)
class Comparison:
    """A target patch, ready for comparison with a reference frame at one resolution."""

    # `patch` is float64 (rows, columns), its mean subtracted here and from `reference`; `cell_px` (2,) its
    # cells in pixels of the target frame; `centre` (2,) the reference box's.

    reference: patches.Window
    centre: Floats
    patch: Floats
    cell_px: Floats

    @classmethod
    def of(
        cls,
        reference: Image,
        target: Image,
        *,
        reference_box: Floats,
        target_box: Floats,
        max_scale: float,
        max_shift: int,
        max_cells: int = patches.MAX_CELLS,
    ) -> Comparison:
        """Cut and shrink what a search up to `max_scale` and `max_shift` needs; raises `Unusable` if flat."""
        n_cells = patches.cells_of(target_box, max_cells=max_cells)
        cell_px = size_of(target_box) / n_cells
        shrink = max(1.0, float(np.max(cell_px)))
        window = patches.cut(
            target, centre=centre_of(target_box), size=size_of(target_box), pixel_size=shrink
        )
        x, y = (
            patches.grid_about(centre, n_cells=n, cell_px=[cell])
            for centre, n, cell in zip(centre_of(target_box), n_cells, cell_px, strict=True)
        )
        (patch,) = window.sample(x, y)
        if patches.is_flat(patch):
            raise Unusable("box without texture")
        centre = centre_of(reference_box)
        size = (n_cells + 2 * max_shift) * cell_px * max_scale
        mean = float(np.mean(patch, dtype=np.float64))
        return cls(
            reference=patches.cut(reference, centre=centre, size=size, pixel_size=shrink).darker(mean),
            centre=centre,
            patch=patch.astype(np.float64) - mean,
            cell_px=cell_px,
        )

    def coarser(self, max_cells: int) -> Comparison:
        """Average cells, to at most `max_cells` along the longer side."""
        n_cells = patches.fewer_cells(self.patch.shape, max_cells=max_cells)
        ratio = float(np.max(self.patch.shape[::-1] / n_cells))
        if ratio <= 1.0:
            return self
        patch = cv2.resize(self.patch, (int(n_cells[0]), int(n_cells[1])), interpolation=cv2.INTER_AREA)
        return replace(
            self,
            reference=self.reference.shrunk(ratio),
            patch=np.asarray(patch, dtype=np.float64),
            cell_px=self.cell_px * self.patch.shape[::-1] / n_cells,
        )

    def errors(self, scales: Floats, *, max_shift: int) -> Floats:
        """Compute mean squared errors (n, 2c + 1, 2c + 1) of scales at shifts −c … c, y before x."""
        errors = self._errors(scales, max_shift, np.float32)
        # In float32 they are true to 1.5e-6 of the variance; where the match is so good that this shows, the
        # few scales are done again.
        close = errors.min(axis=(1, 2)) < CLOSE * self.variance
        if close.any():
            errors[close] = self._errors(scales[close], max_shift, np.float64)
        return errors

    @property
    def variance(self) -> float:
        return self._energy / self.patch.size

    @property
    def _energy(self) -> float:
        return float(np.vdot(self.patch, self.patch))

    def _errors(self, scales: Floats, max_shift: int, kind: type[np.float32 | np.float64]) -> Floats:
        rows, columns = self.patch.shape
        cells = np.multiply.outer(scales, self.cell_px)
        x = patches.grid_about(self.centre[0], n_cells=columns + 2 * max_shift, cell_px=cells[:, 0])
        y = patches.grid_about(self.centre[1], n_cells=rows + 2 * max_shift, cell_px=cells[:, 1])
        sampled = self.reference.sample(x, y).astype(kind, copy=False)
        products = _products(sampled.reshape(len(scales), -1), self._placed(max_shift, kind))
        np.square(sampled, out=sampled)
        energies = _sums_under(sampled, rows=rows, columns=columns)
        errors = energies - 2.0 * products.reshape(energies.shape) + self._energy
        return np.asarray(np.maximum(errors / self.patch.size, 0.0))

    def _placed(self, max_shift: int, kind: type[np.float32 | np.float64]) -> NDArray[Any]:
        """Put the patch at each shift into zeros, ((2c + 1)², cells of the sampled reference)."""
        rows, columns = self.patch.shape
        n_shifts, width = 2 * max_shift + 1, columns + 2 * max_shift
        length = (rows + 2 * max_shift) * width
        # Written row after row, a shift by (dx, dy) is one by dx + dy · row length: zeros move in.
        room = 2 * max_shift * (width + 1)
        framed = np.zeros(room + length, dtype=kind)
        framed[room:].reshape(-1, width)[:rows, :columns] = self.patch
        moved: NDArray[Any] = np.ndarray(
            (n_shifts, n_shifts, length),
            dtype=kind,
            buffer=framed,
            offset=room * framed.itemsize,
            strides=(-width * framed.itemsize, -framed.itemsize, framed.itemsize),
        )
        return moved.reshape(n_shifts**2, length)


def _products(sampled: NDArray[Any], placed: NDArray[Any]) -> NDArray[Any]:
    """Multiply every row of `sampled` (n, cells) by every row of `placed` (k, cells), (n, k)."""
    # In parts, because OpenBLAS takes up to twice as long for a few rows that are long.
    products: NDArray[Any] = sampled[:, :_PART] @ placed[:, :_PART].T
    for start in range(_PART, sampled.shape[1], _PART):
        part = slice(start, start + _PART)
        products += sampled[:, part] @ placed[:, part].T
    return products


def _sums_under(values: NDArray[Any], *, rows: int, columns: int) -> Floats:
    """Sum over all (rows, columns) parts of the n arrays, (n, k, k)."""
    _, n_rows, n_columns = values.shape
    # Down first: that reads the values as they lie.
    down = _band(n_rows, rows, values.dtype).T @ values
    return np.asarray(down.astype(np.float64) @ _band(n_columns, columns, np.dtype(np.float64)))


@lru_cache(maxsize=1024)
def _band(length: int, width: int, kind: np.dtype[Any]) -> NDArray[Any]:
    """Return (length, length − width + 1), read-only: ones in rows i … i + width − 1 of column i.

    >>> _band(3, 2, np.dtype(np.float64)).tolist()
    [[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
    """
    offsets = np.subtract.outer(np.arange(length), np.arange(length - width + 1))
    band = ((offsets >= 0) & (offsets < width)).astype(kind)
    band.setflags(write=False)
    return band


def near_the_best(comparison: Comparison, scales: Floats, *, max_shift: int) -> Floats:
    """Find the scales near the best of every fifth one, by a coarser patch."""
    coarse = comparison.coarser(COARSE_CELLS)
    coarse_shift = math.ceil(max_shift * float(np.max(comparison.cell_px / coarse.cell_px)))
    errors = coarse.errors(scales[::COARSE_STEP], max_shift=coarse_shift)
    index = COARSE_STEP * int(np.argmin(errors.min(axis=(1, 2))))
    return scales[max(0, index - NEAR) : index + NEAR + 1]


def _match(comparison: Comparison, scales: Floats, errors: Floats, *, n_top: int) -> Match:
    least, shifts = at_best_shifts(errors)
    best = best_of(least, n_top=n_top)
    return Match(
        scales=scales,
        errors=least,
        shifts=shifts,
        scale_ratio=weighted_scale_ratio(scales[best], least[best]),
        confidence=1.0 - float(least[best[0]]) / comparison.variance,
    )
