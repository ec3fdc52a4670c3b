"""How fast the times of one object fall while time passes: by one second per second in a good file."""

# With u = 1/τ, two windows dt apart have (u₂ − u₁) / (u₁ u₂) = −(τ₂ − τ₁), which is dt where the speed is
# constant. So Σ (u₂ − u₁) / Σ u₁ u₂ dt is the slope. Noise of both windows cancels in either sum, where the
# mean of (τ₁ − τ₂) / dt would be 0 for a file of noise. Values that are k times too large have the slope k.

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluator.metrics.scale import Floats
from evaluator.truth.ground_truth import Manifest

MIN_STEP_NS: Final = 500_000_000
MAX_STEP_NS: Final = 1_000_000_000
"""Windows of one track are compared if they end so far apart; in the dataset they are 0.6 s apart."""

MAX_WINDOWS: Final = 10
"""So many windows at most lie between both, where windows overlap; at 10 Hz it takes five."""

MIN_PAIRS: Final = 100
NEAR: Final = (0.5, 0.95)
"""Quantiles of the mean of |u| between which a pair counts: the nearer half, without the most extreme."""

N_STANDARD_ERRORS: Final = 2.0

Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Slope:
    """Seconds by which values fall in a second: over all pairs, with its standard error, and the median."""

    overall: float
    standard_error: float
    median: float

    def is_below(self, bound: float) -> bool:
        """Say whether the slope is below the bound, beyond its own uncertainty."""
        return self.overall + N_STANDARD_ERRORS * self.standard_error < bound and self.median < bound

    def is_above(self, bound: float) -> bool:
        """Say whether the slope is above the bound, beyond its own uncertainty."""
        return self.overall - N_STANDARD_ERRORS * self.standard_error > bound and self.median > bound


def slope_of(manifest: Manifest, values: Floats) -> Slope | None:
    """Measure the slope of values (n,) in seconds; None with too few windows of one track."""
    first, second, track = _steps(manifest)
    if len(first) < MIN_PAIRS:
        return None
    with np.errstate(divide="ignore"):
        inverse = 1 / values
    before, after = inverse[first], inverse[second]
    step_s = (manifest.ts_ns[second] - manifest.ts_ns[first]) / 1e9
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        closeness = np.abs(before + after) / 2
        rises, expected = after - before, before * after * step_s
        is_usable = np.isfinite(rises) & np.isfinite(expected)
        low, high = np.quantile(closeness[is_usable], NEAR) if is_usable.any() else (0.0, 0.0)
        is_near = is_usable & (closeness >= low) & (closeness <= high) & (expected != 0)
        slopes = rises[is_near] / expected[is_near]
        total = float(expected[is_near].sum())
        overall = float(rises[is_near].sum()) / total if total else np.nan
        # Of one track the errors are alike, so tracks are what varies.
        of_tracks = np.bincount(track[is_near], weights=rises[is_near] - overall * expected[is_near])
        standard_error = float(np.sqrt(np.square(of_tracks).sum())) / abs(total) if total else np.nan
        has_one_sign = expected[is_near] > 0
        median = float(np.median(slopes[has_one_sign])) if has_one_sign.any() else np.nan
    slope = Slope(overall, standard_error, median)
    return slope if np.isfinite([overall, standard_error, median]).all() else None


@lru_cache(maxsize=4)  # by the manifest itself, which every file of a split shares
def _steps(manifest: Manifest) -> tuple[Rows, Rows, Rows]:
    """Rows of each window and of the next one of its track at least `MIN_STEP_NS` later, and its track."""
    names = [
        f"{bag}/{cam}/{track}"
        for bag, cam, track in zip(manifest.bag_stamp, manifest.cam_id, manifest.track_id, strict=True)
    ]
    tracks = np.unique(np.array(names), return_inverse=True)[1]
    order = np.lexsort((manifest.ts_ns, tracks))
    in_order, ts_ns = tracks[order], manifest.ts_ns[order]
    later = np.full(len(order), -1)
    for n_windows in range(1, min(MAX_WINDOWS, len(order) - 1) + 1):
        is_later = in_order[n_windows:] == in_order[:-n_windows]
        is_later &= ts_ns[n_windows:] - ts_ns[:-n_windows] >= MIN_STEP_NS
        is_later &= later[:-n_windows] < 0
        rows = np.flatnonzero(is_later)
        later[rows] = rows + n_windows
    rows = np.flatnonzero(later >= 0)
    rows = rows[ts_ns[later[rows]] - ts_ns[rows] <= MAX_STEP_NS]
    return order[rows], order[later[rows]], in_order[rows]
