"""The two errors, per sequence: arrays in, arrays out.

Predictions are taken as they are; truncation is the protocol's business (`evaluator.scoring`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from evaluator.scale import Floats, scale_ratio_10hz


def motion_in_depth_error(predicted_ttc_s: ArrayLike, true_ttc_s: ArrayLike) -> Floats:
    """MiD = |ln α₁₀(τ) − ln α₁₀(τ̂)| · 10⁴, the primary metric; lower is better.

    Shapes broadcast. NaN where α₁₀ is not positive.

    >>> round(float(motion_in_depth_error(5.0, 4.0)), 6)
    48.899805
    """
    predicted, true = np.broadcast_arrays(
        np.asarray(predicted_ttc_s, dtype=np.float64), np.asarray(true_ttc_s, dtype=np.float64)
    )
    return depth_error(exact_log(scale_ratio_10hz(true)), scale_ratio_10hz(predicted))


def relative_ttc_error(predicted_ttc_s: ArrayLike, true_ttc_s: ArrayLike) -> Floats:
    """RTE = |(τ̂ − τ) / τ| · 100 %; lower is better. Shapes broadcast.

    >>> float(relative_ttc_error(5.0, 4.0))
    25.0
    """
    predicted = np.asarray(predicted_ttc_s, dtype=np.float64)
    true = np.asarray(true_ttc_s, dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.asarray(np.abs((predicted - true) / true) * 100.0)


METRIC_FUNCTIONS: Final[dict[str, Callable[[ArrayLike, ArrayLike], Floats]]] = {
    "mid": motion_in_depth_error,
    "rte": relative_ttc_error,
}
"""All metrics by the names that scores carry."""


def depth_error(true_log_scale_ratio: Floats, scale_ratio: Floats) -> Floats:
    """MiD from its terms: |L − ln α| · 10⁴ for L = ln α₁₀(τ), made by `exact_log`, and α = α₁₀(τ̂).

    numpy's logarithm is fast, but on some processors the last bit differs from the C library's. Where the two
    logarithms nearly cancel that bit would show, so there the C library's is taken.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.asarray(np.abs(true_log_scale_ratio - np.log(scale_ratio)))
        close = error < 1e-3 * np.abs(true_log_scale_ratio)
    if close.any():
        error[close] = np.abs(true_log_scale_ratio[close] - exact_log(scale_ratio[close]))
    return np.asarray(error * 1e4)


def exact_log(values: Floats) -> Floats:
    """The C library's natural logarithm, as the dataset's toolkit takes it; NaN where it has none."""
    with np.errstate(invalid="ignore"):
        positive = values > 0
    logs = np.full(values.shape, math.nan)
    logs[positive] = np.fromiter(map(math.log, values[positive].tolist()), dtype=np.float64)
    return logs
