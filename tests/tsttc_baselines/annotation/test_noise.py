"""The noise of labels from their jitter: on simulated tracks it is the error that the labels have."""

import numpy as np
import pytest

from evaluator.metrics.registry import MID
from evaluator.problems import Rejected
from evaluator.truth.csv_tables import Table
from tests.tsttc_baselines.annotation.made_tracks import tracks_of
from tsttc_baselines.annotation.noise import label_noise, successive, successive_in_sequences
from tsttc_baselines.annotation.pipeline import annotate


def steady(n_tracks: int = 150, n_frames: int = 25) -> tuple[np.ndarray, np.ndarray]:
    """True depth and time to contact (frames, tracks) at constant velocity."""
    rng = np.random.default_rng(8)
    end_s, mps = rng.uniform(1, 12, n_tracks), rng.uniform(3, 10, n_tracks)
    ttc_s = end_s + np.arange(n_frames)[::-1, np.newaxis] / 10
    return ttc_s * mps, ttc_s


def test_the_noise_is_the_error_of_the_labels() -> None:
    true_m, true_s = steady()
    noisy = true_m + np.random.default_rng(9).normal(0, 0.04, true_m.shape)
    table = annotate(tracks_of(noisy), cut="overlapping").table
    frame, track = np.array(table.ts_ns) // 10**8, np.array(table.track_id, dtype=int)
    error = MID.errors(table.ttc_s, true_s[frame, track])
    whole = np.array(table.ts_ns) >= 9 * 10**8
    estimate = label_noise(*successive(table))[0]
    assert estimate.n_pairs == 150 * 19
    assert estimate.noise == pytest.approx(error[whole].mean(), rel=0.2)
    assert estimate.jitter < estimate.noise


def test_pairs_are_successive_frames_of_one_vehicle() -> None:
    table = Table(
        anno_id=[0, 1, 2, 3, 4],
        bag_stamp=["r"] * 5,
        cam_id=["1"] * 5,
        ts_ns=[200_000_000, 100_000_000, 0, 100_000_000, 400_000_000],
        track_id=["a", "a", "b", "b", "a"],
        ttc_s=[3.0, 3.1, 8.0, 7.9, 2.8],
    )
    earlier, later = successive(table)
    assert sorted(zip(earlier.tolist(), later.tolist(), strict=True)) == [(3.1, 3.0), (8.0, 7.9)]
    earlier, later = successive_in_sequences([[3.0, 2.9, np.nan, 2.7, 2.6, 2.5]])
    assert earlier.tolist() == [3.0, 2.7, 2.6]


def test_labels_of_sequences_that_do_not_overlap_say_nothing() -> None:
    true_m, _ = steady(2)
    with pytest.raises(Rejected, match=r"No two labels of a vehicle are 0\.1 s apart"):
        successive(annotate(tracks_of(true_m)).table)
    with pytest.raises(Rejected, match="No two successive frames have a true time"):
        successive_in_sequences([[3.0, np.nan] * 3])
