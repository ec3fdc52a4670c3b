"""The two errors, per sequence: arrays in, arrays out.

Predictions are taken as they are; truncation is the protocol's business (`evaluator.scoring`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from evaluator.scale import Floats, scale_ratio_10hz


def motion_in_depth_error(predicted_ttc_s: ArrayLike, true_ttc_s: ArrayLike) -> Floats:
    """MiD = |ln α₁₀(τ) − ln α₁₀(τ̂)| · 10⁴, the primary metric; lower is better.

    Shapes broadcast. NaN where α₁₀ is not positive.

    >>> round(float(motion_in_depth_error(5.0, 4.0)), 6)
    48.899833
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        true = np.log(scale_ratio_10hz(true_ttc_s))
        predicted = np.log(scale_ratio_10hz(predicted_ttc_s))
        return np.asarray(np.abs(true - predicted) * 1e4)


def relative_ttc_error(predicted_ttc_s: ArrayLike, true_ttc_s: ArrayLike) -> Floats:
    """RTE = |(τ̂ − τ) / τ| · 100 %; lower is better. Shapes broadcast.

    >>> float(relative_ttc_error(5.0, 4.0))
    25.0
    """
    predicted, true = np.asarray(predicted_ttc_s, dtype=np.float64), np.asarray(true_ttc_s, dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.asarray(np.abs((predicted - true) / true) * 100.0)


METRIC_FUNCTIONS: Final[dict[str, Callable[[ArrayLike, ArrayLike], Floats]]] = {
    "mid": motion_in_depth_error,
    "rte": relative_ttc_error,
}
"""All metrics by the names that scores carry."""
