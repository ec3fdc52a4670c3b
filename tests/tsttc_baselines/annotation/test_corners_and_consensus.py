"""Nearest corners, and velocities that most frames agree on."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, seed, settings
from hypothesis import strategies as st

from evaluator.metrics.registry import MID
from tests.tsttc_baselines.annotation.made_tracks import noisy_windows
from tsttc_baselines.annotation.consensus import consensus_velocity, least_squares_velocity
from tsttc_baselines.annotation.corners import corners_m, nearest_depth_m


def literal_consensus(time_s: np.ndarray, depth_m: np.ndarray, inlier_m: float = 0.15) -> tuple[float, int]:
    """One window, pair by pair."""
    best = 0, np.zeros(len(time_s), dtype=bool)
    for i, j in combinations(range(len(time_s)), 2):
        slope = (depth_m[j] - depth_m[i]) / (time_s[j] - time_s[i])
        inliers = np.abs(depth_m - depth_m[i] - slope * (time_s - time_s[i])) <= inlier_m
        if inliers.sum() > best[0]:
            best = int(inliers.sum()), inliers
    n_inliers, inliers = best
    return float(np.polyfit(time_s[inliers], depth_m[inliers], 1)[0]), n_inliers


def test_the_nearest_corner_is_that_of_the_turned_box() -> None:
    centre, size = np.array([[3.0, 10.0, 0.0], [0.5, -8.0, 0.0]]), np.array([[4.0, 2.0, 1.5]] * 2)
    assert nearest_depth_m(centre, size, np.array([0.0, np.pi / 2])) == pytest.approx([9.0, -6.0])
    turned = corners_m(centre[:1], size[:1], np.array([np.pi / 6]))[0]
    front_left = centre[0, :2] + 2 * np.array([np.cos(np.pi / 6), 0.5]) + np.array([-0.5, np.cos(np.pi / 6)])
    assert np.abs(turned[:, :2] - front_left).sum(axis=1).min() == pytest.approx(0, abs=1e-12)


@seed(16)
@settings(max_examples=40, deadline=None)
@given(
    depth=st.lists(st.integers(-400, 400), min_size=3, max_size=10),
    gaps=st.lists(st.integers(1, 3), min_size=10, max_size=10),
)
def test_all_windows_at_once_are_as_the_loop_over_pairs(depth: list[int], gaps: list[int]) -> None:
    # Hundredths off a grid that the tolerance does not lie on, so that no last digit decides.
    depth_m = np.array(depth) / 97
    time_s = np.cumsum(gaps[: len(depth)]) / 10
    there = np.ones((len(depth), 1), dtype=bool)
    velocity = consensus_velocity(time_s[:, None], depth_m[:, None], there)
    slope, n_inliers = literal_consensus(time_s, depth_m)
    assert velocity.n_inliers[0] == n_inliers
    assert velocity.mps[0] == pytest.approx(slope, rel=1e-9, abs=1e-9)


def test_frames_that_are_not_there_change_nothing() -> None:
    rng = np.random.default_rng(3)
    time_s = np.repeat(np.arange(10)[:, None] / 10, 50, axis=1)
    depth_m = 20 - 5 * time_s + rng.normal(0, 0.1, time_s.shape)
    there = np.ones(time_s.shape, dtype=bool)
    there[:4] = False
    short = consensus_velocity(time_s[4:], depth_m[4:], there[4:])
    velocity = consensus_velocity(time_s, np.where(there, depth_m, 99.0), there)
    assert np.array_equal(velocity.mps, short.mps)
    assert (velocity.n_frames == 6).all()


def test_fewer_than_three_frames_have_no_velocity() -> None:
    time_s, depth_m = np.array([[0.0], [0.1], [0.2]]), np.array([[3.0], [2.0], [1.0]])
    two = np.array([[False], [True], [True]])
    for velocity in (consensus_velocity, least_squares_velocity):
        assert np.isnan(velocity(time_s, depth_m, two).mps).all()
        assert velocity(time_s, depth_m, np.ones((3, 1), dtype=bool)).mps == pytest.approx([-10.0])


def test_velocities_of_ten_noisy_frames_cost_at_most_2_6_mid() -> None:
    time_s, depth_m, true_m, mps = noisy_windows()
    there = np.ones(time_s.shape, dtype=bool)
    velocity = consensus_velocity(time_s, depth_m, there)
    assert MID.errors(-true_m / velocity.mps, -true_m / mps).mean() <= 2.6
    assert MID.errors(-velocity.depth_m / velocity.mps, -true_m / mps).mean() <= 2.6
    plain = least_squares_velocity(time_s, depth_m, there)
    assert MID.errors(-true_m / plain.mps, -true_m / mps).mean() > 10
