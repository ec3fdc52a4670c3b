"""Simulated splits of scripts and highway driving: ground truth, and motions for rendering."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cached_property
from typing import Final

import numpy as np

import evaluator
from evaluator.metrics.scale import FRAME_RATE_HZ, N_FRAMES
from evaluator.truth.csv_tables import Table
from tsttc_baselines import highway, scenarios
from tsttc_baselines.highway import FOCAL_PX, TTC_RANGES_S, VEHICLES, Floats, Track, stretch

SCRIPTED_SHARE: Final = 0.4
"""Of the sequences with τ from 0 to 6 s, about this share comes from the six scripts."""

_SCRIPTED_WIDTHS_PX: Final = (20.0, 240.0)
_FIRST_RECORDING_AT: Final = datetime(2023, 3, 1, 6, 0, tzinfo=UTC)
_FRAME_NS: Final = round(1e9 / FRAME_RATE_HZ)


@dataclass(frozen=True)
class Split:
    """n simulated sequences: their table, and the vehicle's motion in each."""

    table: Table
    vehicle: tuple[int, ...]
    """Index into `highway.VEHICLES`."""
    gap_m: Floats
    """(n, 6): from the camera to the rear of the vehicle."""
    lateral_m: Floats
    """(n, 6): from the optical axis to the middle of the vehicle, to the right."""
    ego_mps: Floats
    """(n,): ego's speed at the target frame."""

    @property
    def n_sequences(self) -> int:
        return len(self.vehicle)

    @cached_property
    def truth(self) -> evaluator.GroundTruth:
        return evaluator.GroundTruth.from_table(self.table)

    @cached_property
    def focal_px(self) -> Floats:
        """The camera's focal length of each sequence (n,), for images 1024 px wide."""
        return np.array([FOCAL_PX[cam_id] for cam_id in self.table.cam_id])


@dataclass(frozen=True, slots=True)
class Shape:
    """The shares of TTC ranges in a split of the dataset, of the sequences within ±20 s."""

    shares: Mapping[str, float]
    share_beyond: float
    """Of all sequences: those with |τ| > 20 s, which lie in no TTC range."""


SHAPES: Final = {
    "val": Shape(shares=highway.SHARES, share_beyond=0.0),
    "test": Shape(
        shares={"crucial": 0.134, "small": 0.132, "large": 0.436, "negative": 0.298}, share_beyond=0.016
    ),
}


def range_counts(*, n_sequences: int, shape: Shape) -> dict[str, int]:
    """Count the sequences of each TTC range, and of those beyond ±20 s.

    >>> range_counts(n_sequences=28_600, shape=SHAPES["test"])["crucial"]
    3771
    """
    n_beyond = round(shape.share_beyond * n_sequences)
    n_inside = n_sequences - n_beyond
    counts = {name: round(share * n_inside) for name, share in shape.shares.items()}
    counts["large"] += n_inside - sum(counts.values())
    return {**counts, "beyond": n_beyond - n_beyond // 2, "receding beyond": n_beyond // 2}


def split(
    *,
    rng: np.random.Generator,
    n_sequences: int,
    n_recordings: int,
    shape: Shape = SHAPES["val"],
) -> Split:
    """Draw a split of this shape; the same generator gives the same split."""
    room = range_counts(n_sequences=n_sequences, shape=shape)
    highway_room = {name: n - _scripted(name, n) for name, n in room.items()}
    scripted_room = {name: _scripted(name, n) for name, n in room.items()}
    tracks = list(_fill_from_scripts(rng, scripted_room))
    for name, n_left in scripted_room.items():  # the scripts may have had too few
        highway_room[name] += n_left
    tracks += _fill_from_highway(rng, highway_room)
    return _assemble(rng, tracks, n_recordings=n_recordings)


def scripted_split(*, rng: np.random.Generator, closed: bool = True) -> Split:
    """Take windows of the scripts' runs with τ from 0.93 to 6 s in full view; a recording is a run."""
    tracks = list(_script_tracks(rng, scenarios.runs(closed=closed)))
    return _assemble(rng, tracks, n_recordings=len(tracks))


def _scripted(ttc_range: str, n: int) -> int:
    return round(SCRIPTED_SHARE * n) if ttc_range in {"crucial", "small"} else 0


def _range_of(ttc_s: float) -> str:
    """Name the TTC range, "none" at the values between ranges."""
    for name, (low_s, high_s) in TTC_RANGES_S.items():
        if low_s <= round(ttc_s, 6) <= high_s:
            return name
    return "none"


def _fill(track: Track, room: dict[str, int], *, around: int) -> Track | None:
    """Return the window and neighbours that have room, and take it; None without room."""
    left = dict(room)
    good = np.zeros(track.ttc_s.size, dtype=bool)
    order = sorted(range(good.size), key=lambda window: abs(window - around))
    for window in order:
        name = _range_of(float(track.ttc_s[window]))
        if left.get(name, 0) > 0:
            left[name] -= 1
            good[window] = True
    if not good[around]:
        return None
    first, last = stretch(good, around=around)
    for ttc_s in track.ttc_s[first:last].tolist():
        room[_range_of(ttc_s)] -= 1
    return track.cut(slice(first, last))


def _fill_from_scripts(rng: np.random.Generator, room: dict[str, int]) -> Iterator[Track]:
    if not any(room.values()):
        return
    runs = scenarios.runs()
    # Enough runs that nothing runs short, and no more: twelve sequences do not need all of them.
    chosen = rng.permutation(len(runs))[: max(64, 2 * sum(room.values()))]
    for track in _script_tracks(rng, [runs[number] for number in chosen.tolist()]):
        filled = _fill(track, room, around=int(rng.integers(track.ttc_s.size)))
        if filled is not None:
            yield filled
        if not any(room.values()):
            return


def _script_tracks(rng: np.random.Generator, runs: list[scenarios.Run]) -> Iterator[Track]:
    """Find each run's longest stretch of windows with 0.93 s ≤ τ ≤ 6 s in view of a random camera."""
    motion = scenarios.solve(runs)
    n_windows = int(motion.end_s.max() * FRAME_RATE_HZ) // N_FRAMES + 1
    state = motion.at(np.arange(n_windows * N_FRAMES) / FRAME_RATE_HZ)
    shape = (len(runs), n_windows, N_FRAMES)
    gap_m, lateral_m, ego_mps, ttc_s = (
        column.reshape(shape) for column in (state.gap_m, state.lateral_m, state.ego_mps, state.ttc_s)
    )
    side = rng.choice((-1.0, 1.0), size=len(runs))
    for number in range(len(runs)):
        cam_id = tuple(FOCAL_PX)[int(rng.integers(len(FOCAL_PX)))]
        vehicle = int(rng.integers(len(VEHICLES)))
        target_s = ttc_s[number, :, -1]
        seen = highway.in_view(
            gap_m=gap_m[number],
            lateral_m=lateral_m[number],
            vehicle=vehicle,
            cam_id=cam_id,
            widths_px=_SCRIPTED_WIDTHS_PX,
        )
        seen &= (target_s >= TTC_RANGES_S["crucial"][0]) & (target_s <= TTC_RANGES_S["small"][1])
        if not seen.any():
            continue
        ends = [stretch(seen, around=window) for window in np.flatnonzero(seen).tolist()]
        first, last = max(ends, key=lambda ends: ends[1] - ends[0])
        yield Track(
            cam_id=cam_id,
            vehicle=vehicle,
            ttc_s=target_s,
            gap_m=gap_m[number],
            lateral_m=side[number] * lateral_m[number],
            ego_mps=ego_mps[number, :, -1],
        ).cut(slice(first, min(last, first + highway.MAX_WINDOWS)))


def _fill_from_highway(rng: np.random.Generator, room: dict[str, int]) -> Iterator[Track]:
    candidates = {name: highway.tracks(rng, ttc_range=name) for name in room}
    while any(room.values()):
        # The range that lacks most of its share goes next, so that all fill up together.
        name = max(room, key=room.__getitem__)
        track, anchor = next(candidates[name])
        filled = _fill(track, room, around=anchor)
        if filled is not None:
            yield filled


def _assemble(rng: np.random.Generator, tracks: list[Track], *, n_recordings: int) -> Split:
    order = rng.permutation(len(tracks)).tolist()
    # Every recording has a track; what is left falls where it will.
    n_more = max(0, len(tracks) - n_recordings)
    recordings = [*range(n_recordings), *rng.integers(n_recordings, size=n_more).tolist()]
    rows = []
    # Tracks of one camera follow one another, so that no two sequences need the same image.
    free_from: dict[tuple[int, str], int] = {}
    for track_number, (index, recording) in enumerate(zip(order, recordings, strict=False)):
        started_at = _FIRST_RECORDING_AT + timedelta(minutes=11 * recording)
        started_ns = round(started_at.timestamp()) * 1_000_000_000
        camera = (recording, tracks[index].cam_id)
        first_frame = free_from.get(camera, 0) + int(rng.integers(30))
        free_from[camera] = first_frame + N_FRAMES * tracks[index].ttc_s.size
        rows += [
            (
                (
                    f"sim-{started_at:%Y%m%d-%H%M%S}",
                    tracks[index].cam_id,
                    started_ns + (first_frame + N_FRAMES * (window + 1) - 1) * _FRAME_NS,
                    str(track_number),
                ),
                index,
                window,
            )
            for window in range(tracks[index].ttc_s.size)
        ]
    rows.sort(key=lambda row: row[0])
    keys, windows = [row[0] for row in rows], [row[1:] for row in rows]
    bag_stamps, cam_ids, ts_ns, track_ids = (list(column) for column in zip(*keys, strict=True))
    return Split(
        table=Table(
            anno_id=list(range(len(rows))),
            bag_stamp=bag_stamps,
            cam_id=cam_ids,
            ts_ns=ts_ns,
            track_id=track_ids,
            ttc_s=[round(float(tracks[index].ttc_s[window]), 6) for index, window in windows],
        ),
        vehicle=tuple(tracks[index].vehicle for index, _ in windows),
        gap_m=np.stack([tracks[index].gap_m[window] for index, window in windows]),
        lateral_m=np.stack([tracks[index].lateral_m[window] for index, window in windows]),
        ego_mps=np.array([tracks[index].ego_mps[window] for index, window in windows]),
    )
