"""Tracks of vehicles whose motion is known, as arrays and as the text of a track.csv."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tsttc_baselines.annotation.tracks import COLUMNS, Tracks

Floats = NDArray[np.float64]
FRAME_NS = 100_000_000
LENGTH_M = 4.0
HEADER = ",".join(COLUMNS)


def tracks_of(depth_m: Floats, *, radar_mps: Floats | None = None) -> Tracks:
    """One track for each column of `depth_m` (frames, tracks), the depth of its nearest corner, at 10 Hz.

    `radar_mps` has the same shape, NaN for gaps.
    """
    n_frames, n_tracks = depth_m.shape
    n = depth_m.size
    return Tracks(
        key=tuple(("r", "1", str(track)) for _ in range(n_frames) for track in range(n_tracks)),
        ts_ns=np.repeat(np.arange(n_frames) * FRAME_NS, n_tracks),
        # At yaw π/2 the length lies along the depth; the vehicle is as wide as it is beside the axis.
        centre_m=np.column_stack([np.full(n, 2.0), depth_m.ravel() + LENGTH_M / 2, np.zeros(n)]),
        size_m=np.tile([LENGTH_M, 1.8, 1.5], (n, 1)),
        yaw_rad=np.full(n, np.pi / 2),
        box_px=np.tile([100.0, 100.0, 140.0, 130.0], (n, 1)),
        is_truncated=np.zeros(n, dtype=np.bool_),
        radar_mps=np.full(n, np.nan) if radar_mps is None else radar_mps.ravel(),
        has_radar=radar_mps is not None,
    )


def row(frame: int, *, track: str = "1", depth_m: float = 20.0, **fields: object) -> str:
    """A line of track.csv; `fields` replace single columns."""
    values: dict[str, object] = {
        "bag_stamp": "r",
        "cam_id": "1",
        "track_id": track,
        "ts": frame * FRAME_NS,
        "x": 2.0,
        "y": depth_m + LENGTH_M / 2,
        "z": 0.0,
        "length": LENGTH_M,
        "width": 1.8,
        "height": 1.5,
        "yaw": np.pi / 2,
        "box_x1": 100,
        "box_y1": 100,
        "box_x2": 140,
        "box_y2": 130,
        "truncated": 0,
        **fields,
    }
    return ",".join(str(values[name]) for name in COLUMNS)


def text(rows: Sequence[str], *, header: str = HEADER) -> str:
    return "\n".join([header, *rows, ""])


def approaching(n_frames: int = 12, **fields: object) -> list[str]:
    """A vehicle that comes 1 m nearer in each frame, from 30 m."""
    return [row(frame, depth_m=30.0 - frame, **fields) for frame in range(n_frames)]


def noisy_windows(n: int = 4_000) -> tuple[Floats, Floats, Floats, Floats]:
    """Times and depths (10, n), σ 5 cm, one in twenty 1 to 5 m off; true depths and velocities (n,)."""
    rng = np.random.default_rng(0)
    true_m = rng.uniform(5, 50, n)
    mps = -true_m / (rng.choice([1, -1], n, p=[0.75, 0.25]) * rng.uniform(1, 20, n))
    time_s = np.repeat(np.arange(-9, 1)[:, None] / 10, n, axis=1)
    depth_m = true_m + mps * time_s + rng.normal(0, 0.05, (10, n))
    off = rng.random((10, n)) < 0.05
    depth_m[off] += rng.uniform(1, 5, off.sum()) * rng.choice([-1, 1], off.sum())
    return time_s, depth_m, true_m, mps
