"""One scale for the sums of all pairs: how far a sum is out in its own distribution under sign flips.

A sum T = Σ ±d_g with Σ d_g² = 1 is about normal if many units have a part in it. If one unit has most of
it, T is never far above that unit's d. The same T then is rarer in one pair than in another. With
K(s) = Σ log cosh(s d_g), the logarithm of T's moment generating function,

    P(T ≥ τ) ≤ exp(−r²/2)        r² = 2 (s τ − K(s)), τ = K'(s)        (Chernoff)

so r is the T of a normal sum that is about as rare; of a normal sum r = T. Near one r, all pairs are compared
by the tangent r + (T − τ) s / r.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from evaluator.metrics.scale import Floats
from evaluator.scoring.uncertainty import Weights

# Σd⁴ times the square of r: below this, Σd⁴ says how a sum differs from a normal one, to 2% of r.
_NEAR_NORMAL: Final = 0.75
# A normal part of every sum: with less, T is read to more digits than signed float32 sums have.
_LEAST_REST: Final = 1e-5
_LOG_2: Final = np.float32(math.log(2))
_MAX_STEPS: Final = 40
# So near the level is near enough: the tangent has its own r.
_NEAR: Final = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Tangents:
    """For each sum T the `slope` and `offset` of slope · T + offset; both (n,)."""

    slope: Floats
    offset: Floats


def tangents(each: Floats, squares: Floats, fourths: Floats, *, level: float, noise: Floats) -> Tangents:
    """Compute the tangents at about r = `level` of the flipped sums of D_g; `each` is D_g², (n, G).

    `squares` and `fourths` are ΣD² > 0 and ΣD⁴; `noise` is the variance of rounding, beside ΣD²; all (n,).
    """
    # Of T = t √ΣD²: r² = t² + κ t⁴ / 6 to the fourth order, κ = ΣD⁴ / (ΣD²)², which is solved for t².
    roots, thirds = np.sqrt(squares), fourths / squares**2 / 3
    t = level * np.sqrt(2 / (1 + np.sqrt(1 + 2 * thirds * level**2)))
    slope = t * (1 + thirds * t**2) / level
    offset = level - slope * t
    few = np.flatnonzero(3 * thirds * level**2 > _NEAR_NORMAL)
    if few.size:
        shares = (each[few] * (1 / squares[few, None])).astype(np.float32)
        np.sqrt(shares, out=shares)
        rest = _LEAST_REST + noise[few]
        # As if one unit had all of Σd⁴.
        largest = np.minimum(np.sqrt(3 * thirds[few]), 1)
        start = _start(largest, 1 - largest + rest, level)
        slope[few], offset[few] = _of_few(shares, rest.astype(np.float32), start.astype(np.float32), level)
    return Tangents(slope / roots, offset)


def _of_few(sizes: Weights, rest: Weights, half_squares: Weights, level: float) -> tuple[Floats, Floats]:
    # Solves s K'(s) − K(s) = level² / 2 by Newton's method for u = s² / 2, of which it is a concave function:
    # from the second step on the steps approach the solution from below. u is at least level² / 2.
    wanted = np.float32(level**2 / 2)
    slope, offset = np.empty((2, len(sizes)))
    left = np.arange(len(sizes))
    totals = sizes.sum(axis=1)
    for _ in range(_MAX_STEPS):
        s = np.sqrt(2 * half_squares)
        # 1 + exp(−2x) of x = s d, of which tanh x = 2 / it − 1, and log cosh x = x + log it − log 2.
        shrunk = sizes * (-2 * s)[:, None]
        np.exp(shrunk, out=shrunk)
        shrunk += 1
        logs = np.log(shrunk).sum(axis=1)
        np.reciprocal(shrunk, out=shrunk)
        log_cosh = s * totals + logs - sizes.shape[1] * _LOG_2
        tau = 2 * np.einsum("ng,ng->n", sizes, shrunk) - totals + rest * s
        reached = s * tau - log_cosh - rest * half_squares
        r = np.sqrt(2 * np.maximum(reached, np.finfo(np.float32).tiny))
        slope[left] = s / r
        offset[left] = r - tau * (s / r)
        is_far = np.abs(reached - wanted) > _NEAR * wanted
        if not is_far.any():
            break
        # Of those that are near, nothing more is computed: a pair's steps do not depend on the others'.
        sizes, rest, totals, left, shrunk = (a[is_far] for a in (sizes, rest, totals, left, shrunk))
        shrunk *= sizes
        # 1 − tanh² = 4 y (1 − y) for y = 1 / (1 + exp(−2x))
        curvature = 4 * (np.einsum("ng,ng->n", sizes, shrunk) - np.einsum("ng,ng->n", shrunk, shrunk)) + rest
        steps = (wanted - reached[is_far]) / curvature
        half_squares = np.maximum(half_squares[is_far] + steps, wanted)
    return slope, offset


def _start(largest: Floats, rest: Floats, level: float) -> Floats:
    """Solve the same for u, of one unit with the square `largest` and a normal sum of variance `rest`."""
    wanted = level**2 / 2
    half_squares = np.full(len(largest), wanted)
    for _ in range(_MAX_STEPS):
        x = np.sqrt(2 * half_squares * largest)
        tanh = np.tanh(x)
        reached = x * tanh - (np.logaddexp(x, -x) - math.log(2)) + rest * half_squares
        is_far = reached < (1 - _NEAR) * wanted
        if not is_far.any():
            break
        steps = (wanted - reached) / (largest * (1 - tanh**2) + rest)
        half_squares = half_squares + np.where(is_far, steps, 0)
    return half_squares
