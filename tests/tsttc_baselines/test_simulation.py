"""Simulated splits: shares, sizes, tracks and motion."""

from itertools import pairwise

import numpy as np
import pytest

from evaluator import TTC_RANGES
from evaluator.metrics.scale import ttc_to_scale_ratio
from tsttc_baselines import simulation
from tsttc_baselines.highway import SHARES
from tsttc_baselines.simulation import SHAPES, Split, split

N = 2_000


@pytest.fixture(scope="module")
def drawn() -> Split:
    return split(rng=np.random.default_rng(5), n_sequences=N, n_recordings=50)


def test_a_split_has_the_shares_of_the_dataset_to_the_sequence(drawn: Split) -> None:
    counts = drawn.truth.counts_of(TTC_RANGES)
    assert counts == {name: pytest.approx(share * N, abs=1) for name, share in SHARES.items()}
    assert drawn.truth.n_outside(TTC_RANGES) == 0
    assert drawn.truth.manifest.n_recordings == 50


@pytest.mark.slow
def test_sequences_beyond_20_s_lie_in_no_range() -> None:
    drawn = split(rng=np.random.default_rng(1), n_sequences=500, n_recordings=9, shape=SHAPES["test"])
    assert drawn.truth.n_outside(TTC_RANGES) == 8


@pytest.mark.slow
def test_the_same_generator_gives_the_same_split_and_another_one_another(drawn: Split) -> None:
    again = split(rng=np.random.default_rng(5), n_sequences=N, n_recordings=50)
    assert again.truth.digest == drawn.truth.digest
    np.testing.assert_array_equal(again.gap_m, drawn.gap_m)
    other = split(rng=np.random.default_rng(6), n_sequences=N, n_recordings=50)
    assert other.truth.digest != drawn.truth.digest


def test_at_constant_speed_the_gaps_have_the_scale_ratio_of_the_truth(drawn: Split) -> None:
    speed = np.diff(drawn.gap_m, axis=1)
    steady = np.ptp(speed, axis=1) < 1e-9
    assert steady.mean() > 0.8
    expected = ttc_to_scale_ratio(drawn.truth.ttc_s[steady], fps_hz=2)
    alpha = drawn.gap_m[steady, -1] / drawn.gap_m[steady, 0]
    np.testing.assert_allclose(alpha, expected, rtol=2e-6)


def test_no_two_sequences_need_the_same_image(drawn: Split) -> None:
    images = [
        (bag, cam, ts - 100_000_000 * k)
        for bag, cam, ts in zip(drawn.table.bag_stamp, drawn.table.cam_id, drawn.table.ts_ns, strict=True)
        for k in range(6)
    ]
    assert len(images) == len(set(images))


def test_the_windows_of_a_track_follow_one_another_and_their_motion_goes_on(drawn: Split) -> None:
    tracks: dict[str, list[int]] = {}
    for row, track in enumerate(drawn.table.track_id):
        tracks.setdefault(track, []).append(row)
    for rows in tracks.values():
        for first, second in pairwise(rows):
            assert drawn.table.ts_ns[second] - drawn.table.ts_ns[first] == 600_000_000
            speed = np.diff(np.concatenate([drawn.gap_m[first], drawn.gap_m[second]]))
            assert np.abs(np.diff(speed)).max() < 0.2


@pytest.mark.slow
def test_the_scripts_alone_make_a_split_with_up_to_6_s_to_contact() -> None:
    drawn = simulation.scripted_split(rng=np.random.default_rng(2), closed=False)
    assert drawn.n_sequences > 1_000
    assert drawn.truth.ttc_s.min() > 0
    assert drawn.truth.ttc_s.max() <= 6
