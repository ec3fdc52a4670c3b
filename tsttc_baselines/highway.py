"""Highway driving: vehicles ahead at constant relative speed, as one of three cameras sees them."""

# Shares of TTC ranges, box widths and focal lengths are those of the dataset.

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluator.metrics.scale import FRAME_RATE_HZ, N_FRAMES

Floats = NDArray[np.float64]

SHARES: Final = {"crucial": 0.138, "small": 0.119, "large": 0.453, "negative": 0.290}
"""The validation set's shares of the TTC ranges; they follow from the rows that the paper prints."""

IMAGE_WIDTH_PX: Final = 1024
IMAGE_HEIGHT_PX: Final = 576
FOCAL_PX: Final = {"1": 602.0, "2": 259.0, "3": 1539.0}
"""Focal lengths by `cam_id`, for images 1024 px wide."""
CAMERA_HEIGHT_M: Final = 1.5

TTC_RANGES_S: Final = {
    "crucial": (0.93, 2.999),
    "small": (3.001, 5.999),
    "large": (6.001, 19.999),
    "negative": (-19.999, -1.5),
    "beyond": (20.001, 60.0),
    "receding beyond": (-60.0, -20.001),
}
"""Where τ is drawn from, in seconds: inside each range, so that no sequence counts twice.

The paper's scale bins reach from 0.93 s to −1.5 s, "to cover samples in the training set".
"""

BOX_WIDTHS_PX: Final = (20.0, 200.0)
WINDOW_S: Final = N_FRAMES / FRAME_RATE_HZ
"""From one six-frame window to the next; they do not overlap."""
MAX_WINDOWS: Final = 12
_FASTEST_MPS: Final = 40.0
_LANES_M: Final = (0.0, 0.0, 0.0, -3.75, 3.75)
_EDGE_PX: Final = 24.0


@dataclass(frozen=True, slots=True)
class Vehicle:
    name: str
    width_m: float
    height_m: float
    cabin_m: float
    """How far the rear window lies behind the tail, seen from the camera."""


VEHICLES: Final = (
    Vehicle("sedan", width_m=1.82, height_m=1.46, cabin_m=0.7),
    Vehicle("hatchback", width_m=1.78, height_m=1.52, cabin_m=0.15),
    Vehicle("suv", width_m=1.92, height_m=1.72, cabin_m=0.2),
    Vehicle("van", width_m=2.0, height_m=2.25, cabin_m=0.0),
    Vehicle("truck", width_m=2.5, height_m=3.1, cabin_m=0.0),
)


@dataclass(frozen=True, slots=True)
class Track:
    """One vehicle in consecutive windows of one camera: arrays are (n,) or (n, 6 frames)."""

    cam_id: str
    vehicle: int
    """Index into `VEHICLES`."""
    ttc_s: Floats
    """τ at the target frame of each window."""
    gap_m: Floats
    lateral_m: Floats
    """From the optical axis to the middle of the vehicle, to the right."""
    ego_mps: Floats

    def cut(self, windows: slice) -> Track:
        return Track(
            cam_id=self.cam_id,
            vehicle=self.vehicle,
            ttc_s=self.ttc_s[windows],
            gap_m=self.gap_m[windows],
            lateral_m=self.lateral_m[windows],
            ego_mps=self.ego_mps[windows],
        )


def in_view(
    *, gap_m: Floats, lateral_m: Floats, vehicle: int, cam_id: str, widths_px: tuple[float, float]
) -> NDArray[np.bool_]:
    """Find the windows (n,) with the whole vehicle in all six frames, and a target box of allowed width."""
    focal_px, width_m = FOCAL_PX[cam_id], VEHICLES[vehicle].width_m
    with np.errstate(divide="ignore", invalid="ignore"):
        reach_px = focal_px * (np.abs(lateral_m) + width_m / 2) / gap_m
        width_px = focal_px * width_m / gap_m
    inside = (gap_m > 0) & (reach_px <= IMAGE_WIDTH_PX / 2 - _EDGE_PX) & (width_px <= 1.4 * widths_px[1])
    target = (width_px[:, -1] >= widths_px[0]) & (width_px[:, -1] <= widths_px[1])
    return np.asarray(inside.all(axis=1) & target)


def tracks(rng: np.random.Generator, *, ttc_range: str) -> Iterator[tuple[Track, int]]:
    """Yield endless tracks, each with the number of its window in this TTC range."""
    # That window's τ is uniform, its box width log-uniform in 20–200 px. Along a track τ falls by 0.6 s a
    # window; windows with a vehicle too small, too large or partly outside are left out.
    while True:
        for draw in rng.random((256, 8)):
            track = _track(draw, range_s=TTC_RANGES_S[ttc_range])
            if track is not None:
                yield track


def _track(draw: Floats, *, range_s: tuple[float, float]) -> tuple[Track, int] | None:
    """Make a track from eight uniform numbers, None if it is too fast for traffic."""
    width_px = BOX_WIDTHS_PX[0] * (BOX_WIDTHS_PX[1] / BOX_WIDTHS_PX[0]) ** draw[0]
    cam_id = tuple(FOCAL_PX)[int(draw[1] * len(FOCAL_PX))]
    vehicle = int(draw[2] * len(VEHICLES))
    anchor_s = range_s[0] + (range_s[1] - range_s[0]) * draw[3]
    anchor_gap_m = FOCAL_PX[cam_id] * VEHICLES[vehicle].width_m / width_px
    closing_mps = anchor_gap_m / anchor_s
    if abs(closing_mps) > _FASTEST_MPS:
        return None
    n_windows = 3 + int(draw[4] * (MAX_WINDOWS - 2))
    anchor = int(draw[5] * n_windows)
    targets_s = anchor_s - WINDOW_S * (np.arange(n_windows) - anchor)
    frames_s = targets_s[:, None] + np.arange(N_FRAMES - 1, -1, -1) / FRAME_RATE_HZ
    passed_s = anchor_s - frames_s
    gap_m = closing_mps * frames_s
    lane_m = _LANES_M[int(draw[6] * len(_LANES_M))]
    lateral_m = lane_m + 0.6 * (draw[7] - 0.5) + 0.3 * (draw[4] - 0.5) * passed_s
    seen = in_view(gap_m=gap_m, lateral_m=lateral_m, vehicle=vehicle, cam_id=cam_id, widths_px=BOX_WIDTHS_PX)
    low_s, high_s = (-60.0, -1.5) if anchor_s < 0 else (0.93, 60.0)
    seen &= (targets_s >= low_s) & (targets_s <= high_s)
    if not seen[anchor]:
        return None
    first, last = stretch(seen, around=anchor)
    track = Track(
        cam_id=cam_id,
        vehicle=vehicle,
        ttc_s=targets_s,
        gap_m=gap_m,
        lateral_m=lateral_m,
        ego_mps=np.full(n_windows, 18 + 18 * draw[5]),
    )
    return track.cut(slice(first, last)), anchor - first


def stretch(good: NDArray[np.bool_], *, around: int) -> tuple[int, int]:
    """Find the longest run of good neighbours that includes `around`, as (first, last + 1).

    >>> stretch(np.array([True, False, True, True]), around=3)
    (2, 4)
    """
    bad = np.flatnonzero(~good)
    before, after = bad[bad < around], bad[bad > around]
    return int(before[-1]) + 1 if before.size else 0, int(after[0]) if after.size else good.size
