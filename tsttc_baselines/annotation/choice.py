"""Which window gives the time to contact: the longest, or where they differ the nearest to the radar."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluator.metrics.registry import MID
from evaluator.metrics.scale import Floats

WINDOWS: Final = (3, 5, 10)
"""Frames of the paper's windows, q; the last is its default."""

VARIED_MID: Final = 20.0
"""Windows that differ by more (MiD ×10⁻⁴) belong to a vehicle that accelerates. The paper does not say."""

REASONS: Final = {
    "agree": "the windows agree, so the longest is taken",
    "radar": "the windows differ, and the one nearest to the radar's time to contact is taken",
    "no-radar": "the windows differ and the frame has no radar velocity, so the longest is taken",
}
"""The values of the column `choice`, with what they mean."""


def choose(ttc_s: Floats, radar_ttc_s: Floats) -> tuple[NDArray[np.intp], NDArray[np.str_]]:
    """Choose each frame's window by MiD to `radar_ttc_s` (n,): index, and key of `REASONS`."""
    # `ttc_s` (m, n) is in seconds by window, the longest last; NaN if absent.
    n_windows, n = ttc_s.shape
    spread = np.zeros(n)
    for first in range(n_windows):
        for second in range(first):
            spread = np.maximum(spread, _distance(ttc_s[first], ttc_s[second]))
    varied, has_radar = spread > VARIED_MID, ~np.isnan(radar_ttc_s)
    by_radar = varied & has_radar
    # Reversed, so that of equally near windows the longest is taken.
    nearest = n_windows - 1 - np.argmin(_distance(ttc_s[::-1], radar_ttc_s), axis=0)
    index = np.where(by_radar, nearest, n_windows - 1)
    return index, np.where(by_radar, "radar", np.where(varied, "no-radar", "agree"))


def _distance(ttc_s: Floats, other_s: Floats) -> Floats:
    with np.errstate(invalid="ignore"):
        distance = MID.errors(ttc_s, other_s)
    return np.where(np.isnan(distance), np.inf, distance)
