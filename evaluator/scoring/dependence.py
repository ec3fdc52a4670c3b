"""The likeness of recordings of one unit, such as a day, and how much it widens a standard error.

With u_g = S_g − θ n_g, the part of recording g in the error of the mean θ of N sequences,

    SE²_recording = Σ u_g² / N²        SE²_unit = Σ_d (Σ_{g in d} u_g)² / N²        (Liang and Zeger 1986)

The correlation within a unit is Σ_{g ≠ h, same unit} u_g u_h / Σ n_g n_h ÷ (Σ u_g² / Σ n_g²); its p comes
from permuting units over recordings.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from evaluator.metrics.scale import Floats
from evaluator.scoring.uncertainty import by_units
from evaluator.units import Units

N_PERMUTATIONS: Final = 1_999


@dataclass(frozen=True, slots=True)
class Dependence:
    """Standard error by units over that by recordings, correlation within a unit, one-sided p."""

    se_factor: float
    correlation: float
    p: float


def dependence(
    sums: Floats, counts: Floats, units: Units, *, rng: np.random.Generator, n: int = N_PERMUTATIONS
) -> Dependence | None:
    """Measure one column by `sums` and `counts` (G,) of recordings; None without units of two."""
    rests = sums - sums.sum() / counts.sum() * counts if counts.sum() else np.zeros_like(sums)
    square = float((rests**2).sum())
    orders = np.stack([np.arange(len(sums)), *(rng.permutation(len(sums)) for _ in range(n))], axis=1)
    # One column for each order: what stands first is as it was recorded.
    totals, sizes = by_units(rests[orders], units), by_units(counts[orders], units)
    products = (totals**2).sum(axis=0) - square
    pairs = (sizes**2).sum(axis=0) - (counts**2).sum()
    if not square or not pairs[0]:
        return None
    scale = square / float((counts**2).sum())
    correlations = np.divide(products, pairs, out=np.zeros_like(pairs), where=pairs > 0) / scale
    n_as_large = int((correlations[1:] >= correlations[0]).sum())
    return Dependence(
        se_factor=float(np.sqrt((totals[:, 0] ** 2).sum() / square)),
        correlation=float(correlations[0]),
        p=(1 + n_as_large) / (n + 1),
    )
