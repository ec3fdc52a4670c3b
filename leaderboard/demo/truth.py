"""Simulated ground truth that has the shape of the real test set: its size, its recordings, its intervals."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import numpy as np
from numpy.typing import NDArray

import evaluator
from evaluator.scale import FRAME_RATE_HZ, N_FRAMES
from evaluator.tables import Table

N_SEQUENCES = 28_600
N_RECORDINGS = 700

SHARES = {"crucial": 0.134, "small": 0.132, "large": 0.436, "negative": 0.298}
"""The real test set's shares, of the sequences that lie in an interval: they add up to one."""

OUT_OF_RANGE_SHARE = 0.016
"""Of all sequences: those with |τ| > 20 s, which lie in no interval. Taken off before `SHARES` apply."""

# Where τ is drawn from, in seconds: strictly inside each interval, so that no sequence counts twice, and
# away from the values around 0 that neither the dataset nor the metrics have.
_RANGES_S = {
    "crucial": (0.3, 2.999),
    "small": (3.001, 5.999),
    "large": (6.001, 19.999),
    "negative": (-19.999, -1.0),
    "beyond": (20.001, 60.0),
    "receding beyond": (-60.0, -20.001),
}
_WINDOWS_OF_A_TRACK = (3, 13)
_CAMERAS = ("1", "2", "3")
_FIRST_RECORDING_AT = datetime(2023, 3, 1, 6, 0, tzinfo=UTC)
_FRAME_NS = round(1e9 / FRAME_RATE_HZ)


@dataclass(frozen=True)
class _Track:
    """One object as one camera sees it: τ in seconds of its consecutive six-frame windows."""

    ttc_s: NDArray[np.float64]


def interval_counts(*, n_sequences: int) -> dict[str, int]:
    """How many sequences each interval has, and how many lie beyond ±20 s; they add up to `n_sequences`.

    >>> interval_counts(n_sequences=28_600)["crucial"]
    3771
    """
    n_beyond = round(OUT_OF_RANGE_SHARE * n_sequences)
    n_inside = n_sequences - n_beyond
    counts = {name: round(share * n_inside) for name, share in SHARES.items()}
    counts["large"] += n_inside - sum(counts.values())
    return {**counts, "beyond": n_beyond - n_beyond // 2, "receding beyond": n_beyond // 2}


def simulate(
    *, rng: np.random.Generator, n_sequences: int = N_SEQUENCES, n_recordings: int = N_RECORDINGS
) -> evaluator.GroundTruth:
    """Ground truth made of tracks that are spread over recordings; the same generator gives the same values.

    A track is a run of windows cut without overlap, as in the dataset, along which τ falls: at constant
    relative speed an approaching object comes closer, and a receding one has been gone for longer.
    """
    tracks = [
        track
        for name, count in interval_counts(n_sequences=n_sequences).items()
        for track in _tracks(rng, range_s=_RANGES_S[name], n_windows=count)
    ]
    order = rng.permutation(len(tracks))
    # Every recording has a track; what is left falls where it will.
    recordings = np.concatenate(
        [np.arange(n_recordings), rng.integers(n_recordings, size=max(0, len(tracks) - n_recordings))]
    )
    rows: list[tuple[str, str, int, str, float]] = []
    for track_number, (index, recording) in enumerate(zip(order, recordings, strict=False)):
        rows += _rows(rng, tracks[index], recording=int(recording), track_number=track_number)
    rows.sort(key=lambda row: row[:4])
    bag_stamps, cam_ids, ts_ns, track_ids, ttc_s = (list(column) for column in zip(*rows, strict=True))
    return evaluator.GroundTruth.from_table(
        Table(
            anno_id=list(range(len(rows))),
            bag_stamp=bag_stamps,
            cam_id=cam_ids,
            ts_ns=ts_ns,
            track_id=track_ids,
            ttc_s=ttc_s,
        )
    )


def _tracks(rng: np.random.Generator, *, range_s: tuple[float, float], n_windows: int) -> list[_Track]:
    """Tracks within a range of τ that have `n_windows` windows together."""
    low_s, high_s = range_s
    tracks = []
    while n_windows:
        length = min(int(rng.integers(*_WINDOWS_OF_A_TRACK)), n_windows)
        n_windows -= length
        ttc_s = np.round(rng.uniform(low_s, high_s, size=length), 6)
        tracks.append(_Track(ttc_s=np.sort(ttc_s)[::-1]))
    return tracks


def _rows(
    rng: np.random.Generator, track: _Track, *, recording: int, track_number: int
) -> list[tuple[str, str, int, str, float]]:
    """(bag_stamp, cam_id, ts of the target frame in ns, track_id, τ in s) of each window."""
    started_at = _FIRST_RECORDING_AT + timedelta(minutes=11 * recording)
    started_ns = round(started_at.timestamp()) * 1_000_000_000
    first_frame = int(rng.integers(600))
    cam_id = _CAMERAS[int(rng.integers(len(_CAMERAS)))]
    return [
        (
            f"sim-{started_at:%Y%m%d-%H%M%S}",
            cam_id,
            started_ns + (first_frame + N_FRAMES * (window + 1) - 1) * _FRAME_NS,
            str(track_number),
            float(ttc_s),
        )
        for window, ttc_s in enumerate(track.ttc_s)
    ]
