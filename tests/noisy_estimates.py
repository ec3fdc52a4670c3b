"""Invented estimators: the simulated truth seen through noise of the kind that real ones have.

An estimator that measures how an object grows between two frames is wrong about the scale ratio, so the
noise is put there: on ln α at 10 Hz, in units of 10⁻⁴, which is what motion-in-depth error (MiD) measures.
What it does to τ then follows: little when contact is near, much when it is far. Part of it is shared by a
whole recording, as rain, night and calibration are, so that the sequences of a recording are not
independent.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import evaluator
from evaluator.metrics.scale import FRAME_RATE_HZ, scale_ratio_to_ttc, ttc_to_scale_ratio

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Estimator:
    """How one invented estimator errs; noise levels in 10⁻⁴ of ln α at 10 Hz."""

    noise: float
    recording_noise: float = 0.0
    near_s: float = 2.5
    """Objects at this τ have twice the noise of far ones: they grow fast and leave the picture."""
    outlier_share: float = 0.0
    outlier_factor: float = 8.0

    def predict(self, *, truth: evaluator.GroundTruth, rng: np.random.Generator) -> Floats:
        """Predicted τ in seconds, (n,), in the order of the manifest."""
        n = truth.n_sequences
        level = self.noise * (1 + self.near_s / np.abs(truth.ttc_s))
        level = np.where(rng.random(n) < self.outlier_share, level * self.outlier_factor, level)
        shared = rng.normal(scale=self.recording_noise, size=truth.manifest.n_recordings)
        error = rng.normal(scale=level) + shared[truth.manifest.recording_index]
        alpha = ttc_to_scale_ratio(truth.ttc_s, fps_hz=FRAME_RATE_HZ) * np.exp(error * 1e-4)
        # Six decimals, as far as anybody would print it; a microsecond stands for the 0 that no file may
        # hold.
        ttc_s = np.round(np.clip(scale_ratio_to_ttc(alpha, fps_hz=FRAME_RATE_HZ), -1e6, 1e6), 6)
        return np.where(ttc_s == 0, 1e-6, ttc_s)
