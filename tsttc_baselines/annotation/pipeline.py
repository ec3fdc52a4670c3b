"""Ground truth from tracks: depth, velocity and time to contact of every frame, then sequences."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from evaluator.metrics.scale import FRAME_RATE_HZ, N_FRAMES, Floats, scale_ratio_10hz
from evaluator.problems import reject
from evaluator.truth.annotations import FRAME_STEP_NS, Camera, cut_sequences
from evaluator.truth.csv_tables import COLUMNS, Table
from evaluator.truth.pickles import Attributes
from tsttc_baselines.annotation.choice import REASONS, WINDOWS, choose
from tsttc_baselines.annotation.consensus import (
    INLIER_M,
    MIN_FRAMES,
    Velocities,
    consensus_velocity,
    least_squares_velocity,
)
from tsttc_baselines.annotation.corners import nearest_depth_m
from tsttc_baselines.annotation.tracks import Key, Tracks

MIN_BOX_PX: Final = 15.0
"""Width and height from which the paper takes a box."""

JUMP_M: Final = 0.7
"""A frame has jumped if its distance to the frame before is off by more from what its velocity says:
by 7 m/s, which hard braking needs a second for.
"""

Cut = Literal["toolkit", "overlapping"]
Depth = Literal["checked", "measured", "consensus"]
DEPTHS: Final[tuple[Depth, ...]] = get_args(Depth)
Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class FrameTtc:
    """Estimates of n observations: `ttc_s` = −`depth_m` / velocity in seconds, NaN without a velocity."""

    # From the window `q` with `n_frames` frames, of which `n_inliers` agree, by `choice`, a key of `REASONS`.

    depth_m: Floats
    ttc_s: Floats
    q: NDArray[np.int64]
    n_frames: NDArray[np.int64]
    n_inliers: NDArray[np.int64]
    choice: NDArray[np.str_]


@dataclass(frozen=True, eq=False)
class Annotation:
    """Ground truth with the origin of each value: `rows` (m, 6) are each sequence's observations."""

    table: Table
    frames: FrameTtc
    rows: Indices
    counts: Mapping[str, int]

    def text(self) -> str:
        """Write a CSV file for `read_truth`, with the further columns q, frames, inliers and choice."""
        frames, target = self.frames, self.rows[:, -1]
        further = zip(
            *(
                column[target].tolist()
                for column in (frames.q, frames.n_frames, frames.n_inliers, frames.choice)
            ),
            strict=True,
        )
        head, *lines = self.table.text(COLUMNS).splitlines()
        rows = (f"{line},{','.join(map(str, values))}" for line, values in zip(lines, further, strict=True))
        return "\n".join([f"{head},q,frames,inliers,choice", *rows, ""])


def annotate(
    tracks: Tracks, *, cut: Cut = "toolkit", depth: Depth = "checked", inlier_m: float = INLIER_M
) -> Annotation:
    """Create ground truth from tracks (paper, 4.2); raises `Rejected` if no sequence remains.

    `cut` is the toolkit's (no overlap) or "overlapping" (every six successive frames); `depth` is that of
    `frame_ttc`.
    """
    # Velocities use all frames; truncated or small boxes then end a sequence.
    frames = frame_ttc(tracks, depth=depth, inlier_m=inlier_m)
    with np.errstate(invalid="ignore"):
        size_px = tracks.box_px[:, 2:] - tracks.box_px[:, :2]
        is_small = (size_px < MIN_BOX_PX).any(axis=1)
    has_box = ~np.isnan(size_px[:, 0])
    is_usable = has_box & ~is_small & ~tracks.is_truncated
    rows = np.array(list(_sequences(tracks, np.flatnonzero(is_usable), cut)), dtype=np.intp)
    rows = rows.reshape(-1, N_FRAMES)
    is_finite, is_defined = _finite_and_defined(frames.ttc_s[rows[:, -1]])
    kept = rows[is_finite & is_defined]
    n_of_track = Counter(tracks.key)
    counts = {
        "observations": tracks.n_observations,
        "tracks": len(n_of_track),
        "short_tracks": sum(n < N_FRAMES for n in n_of_track.values()),
        "truncated": int(np.count_nonzero(tracks.is_truncated)),
        "without_box": int(np.count_nonzero(~has_box)),
        "small_box": int(np.count_nonzero(is_small & ~tracks.is_truncated)),
        "without_radar": int(np.isnan(tracks.radar_mps).sum()) if tracks.has_radar else 0,
        "sequences": len(kept),
        "standing_still": int(np.count_nonzero(~is_finite)),
        "undefined_error": int(np.count_nonzero(is_finite & ~is_defined)),
        **{f"choice_{reason}": int((frames.choice[kept[:, -1]] == reason).sum()) for reason in REASONS},
    }
    if not len(kept):
        message = (
            f"No sequence remains of {tracks.n_observations:,} observations of {len(n_of_track):,} vehicles; "
            f"expected {N_FRAMES} frames of a vehicle exactly 0.1 s apart, not truncated, with boxes of at "
            f"least {MIN_BOX_PX:g} pixels."
        )
        raise reject("empty", message)
    return Annotation(_table(tracks, frames, kept), frames, kept, counts)


def _finite_and_defined(ttc_s: Floats) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    # A ground truth needs both.
    alpha = scale_ratio_10hz(ttc_s)
    with np.errstate(invalid="ignore"):
        is_defined = (alpha > 0) & np.isfinite(alpha) & ((ttc_s > 0) | (ttc_s < -0.1))
    return np.isfinite(ttc_s), is_defined


def _table(tracks: Tracks, frames: FrameTtc, rows: Indices) -> Table:
    targets = rows[:, -1].tolist()
    keys = [tracks.key[row] for row in targets]
    return Table(
        anno_id=list(range(len(targets))),
        bag_stamp=[key[0] for key in keys],
        cam_id=[key[1] for key in keys],
        ts_ns=tracks.ts_ns[targets].tolist(),
        track_id=[key[2] for key in keys],
        ttc_s=frames.ttc_s[targets].tolist(),
    )


# --- time to contact -------------------------------------------------------------------------------------


def frame_ttc(tracks: Tracks, *, depth: Depth = "checked", inlier_m: float = INLIER_M) -> FrameTtc:
    """Compute τ = −y / ẏ of every observation from its past 3, 5 and 10 frames, and choose among them.

    y is the nearest corner's (Eq. 2), ẏ by least squares over 3 frames, by consensus over 5 and 10. The depth
    "measured" is the paper's; "consensus" replaces outliers by the line: better where boxes jump, worse under
    acceleration; "checked" does so only for jumps over `JUMP_M`.
    """
    depth_m = nearest_depth_m(tracks.centre_m, tracks.size_m, tracks.yaw_rad)
    index, is_there = past_frames(tracks, n_frames=WINDOWS[-1])
    time_s = (tracks.ts_ns[index] - tracks.ts_ns) / 1e9
    velocities = [
        _velocities(time_s[-q:], depth_m[index[-q:]], is_there[-q:], inlier_m=inlier_m) for q in WINDOWS
    ]
    is_after_frame = is_there[-2] & _is_recent(time_s[-2:])[0]
    step_m = depth_m - depth_m[index[-2]]

    def on_line(velocity: Velocities) -> NDArray[np.bool_]:
        if depth != "checked":
            return np.full(depth_m.shape, depth == "consensus")
        return np.asarray(is_after_frame & (np.abs(step_m + velocity.mps * time_s[-2]) > JUMP_M))

    with np.errstate(divide="ignore", invalid="ignore"):
        ttc_s = np.stack([-np.where(on_line(v), v.depth_m, depth_m) / v.mps for v in velocities])
        radar_ttc_s = -np.abs(depth_m) / tracks.radar_mps
    chosen, reason = choose(ttc_s, radar_ttc_s)
    columns = np.arange(tracks.n_observations)
    return FrameTtc(
        depth_m=depth_m,
        ttc_s=ttc_s[chosen, columns],
        q=np.array(WINDOWS)[chosen],
        n_frames=np.stack([velocity.n_frames for velocity in velocities])[chosen, columns],
        n_inliers=np.stack([velocity.n_inliers for velocity in velocities])[chosen, columns],
        choice=reason,
    )


def _velocities(
    time_s: Floats, depth_m: Floats, is_there: NDArray[np.bool_], *, inlier_m: float
) -> Velocities:
    # Frames that are older than q frames at 10 Hz do not count: a track that was lost begins anew.
    is_there = is_there & _is_recent(time_s)
    if len(time_s) <= MIN_FRAMES:
        return least_squares_velocity(time_s, depth_m, is_there)
    return consensus_velocity(time_s, depth_m, is_there, inlier_m=inlier_m)


def _is_recent(time_s: Floats) -> NDArray[np.bool_]:
    """Find the frames (q, n) within q frames at 10 Hz."""
    return np.asarray(-time_s < (len(time_s) - 0.5) / FRAME_RATE_HZ)


def past_frames(tracks: Tracks, *, n_frames: int) -> tuple[Indices, NDArray[np.bool_]]:
    """Return rows (q, n) of each observation's past frames, itself last, and which exist."""
    n = tracks.n_observations
    names = {key: number for number, key in enumerate(dict.fromkeys(tracks.key))}
    track = np.array([names[key] for key in tracks.key])
    order = np.argsort(track, kind="stable")  # within a track the rows stand in the order of time
    position = np.arange(n) - np.arange(n_frames)[::-1, np.newaxis]
    index = np.empty((n_frames, n), dtype=np.intp)
    index[:, order] = order[np.maximum(position, 0)]
    is_there = np.empty((n_frames, n), dtype=np.bool_)
    is_there[:, order] = position >= 0
    return index, is_there & (track[index] == track)


# --- sequences -------------------------------------------------------------------------------------------


def _sequences(tracks: Tracks, usable: Indices, cut: Cut) -> Iterator[list[int]]:
    cameras: dict[tuple[str, str], Camera] = {}
    for row in usable.tolist():
        key, ts_ns = tracks.key[row], int(tracks.ts_ns[row])
        seen = Attributes({"id": key, "ts": ts_ns, "row": row})
        cameras.setdefault(key[:2], {}).setdefault(ts_ns, []).append(seen)
    for name in sorted(cameras):
        sequences = cut_sequences(cameras[name]) if cut == "toolkit" else _overlapping(cameras[name])
        for sequence in sequences:
            yield [seen["row"] for seen in sequence]


def _overlapping(camera: Camera) -> Iterator[list[Attributes]]:
    open_tracks: dict[Key, list[Attributes]] = {}
    for stamp in sorted(camera):
        for seen in camera[stamp]:
            track = open_tracks.setdefault(seen["id"], [])
            if track and seen["ts"] - track[-1]["ts"] != FRAME_STEP_NS:
                track.clear()
            track.append(seen)
            if len(track) >= N_FRAMES:
                yield track[-N_FRAMES:]
                track.pop(0)
