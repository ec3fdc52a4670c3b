"""The consensus over all pairs of frames beside scikit-learn's RANSAC, which need not be installed.

Everything runs in one thread, and times are the processor's.
"""

import time
from importlib.util import find_spec

import numpy as np

from baselines.annotation.consensus import INLIER_M, consensus_velocity
from evaluator.metrics.metrics import MID

N_WINDOWS = 28_600
N_RANSAC = 300
N_TIMES = 3


def windows() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times and depths (10, n) with σ 5 cm and 5 % of outliers, and the true scale of time, τ + t."""
    rng = np.random.default_rng(0)
    true_m, ttc_s = rng.uniform(5, 50, N_WINDOWS), rng.uniform(1, 20, N_WINDOWS)
    time_s = np.repeat(np.arange(-9, 1)[:, None] / 10, N_WINDOWS, axis=1)
    depth_m = true_m * (1 - time_s / ttc_s) + rng.normal(0, 0.05, time_s.shape)
    off = rng.random(time_s.shape) < 0.05
    depth_m[off] += rng.uniform(1, 5, off.sum()) * rng.choice([-1, 1], off.sum())
    return time_s, depth_m, np.array([true_m, ttc_s])


def ransac_mps(time_s: np.ndarray, depth_m: np.ndarray) -> np.ndarray:
    """The velocity of each window by scikit-learn, with the same tolerance."""
    from sklearn.linear_model import RANSACRegressor  # noqa: PLC0415 -- need not be installed

    model = RANSACRegressor(residual_threshold=INLIER_M, random_state=0)
    fits = (model.fit(t[:, None], y).estimator_.coef_[0] for t, y in zip(time_s.T, depth_m.T, strict=True))
    return np.array(list(fits))


def main() -> None:
    """Measure and print."""
    time_s, depth_m, (true_m, ttc_s) = windows()
    there = np.ones(time_s.shape, dtype=bool)
    durations_s = []
    for _ in range(N_TIMES):
        begun_s = time.process_time()
        found = consensus_velocity(time_s, depth_m, there)
        durations_s.append(time.process_time() - begun_s)
    own_us = 1e6 * min(durations_s) / N_WINDOWS
    print(f"annotation.consensus = {own_us:.2f} µs")
    print(f"annotation.consensus_error = {MID.errors(-true_m / found.mps, ttc_s).mean():.2f} MiD")
    if find_spec("sklearn") is None:
        print("annotation.ransac was not measured: scikit-learn is not installed")
        return
    begun_s = time.process_time()
    few = ransac_mps(time_s[:, :N_RANSAC], depth_m[:, :N_RANSAC])
    ransac_us = 1e6 * (time.process_time() - begun_s) / N_RANSAC
    errors = [
        MID.errors(-true_m[:N_RANSAC] / mps, ttc_s[:N_RANSAC]).mean() for mps in (few, found.mps[:N_RANSAC])
    ]
    print(f"annotation.ransac = {ransac_us:.0f} µs")
    print(f"annotation.consensus_over_ransac = {ransac_us / own_us:.0f} times as fast")
    print(f"annotation.ransac_error = {errors[0]:.2f} MiD, consensus on the same {errors[1]:.2f} MiD")
