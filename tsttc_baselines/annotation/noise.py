"""The noise of labels, from labels alone.

    of_range = label_noise(*successive(truth.to_table()))

Without acceleration, τ(t) = τ(t − 0.1 s) − 0.1 s; the remaining difference is the noise of two labels, less
what they share: they come from nearly the same frames.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from evaluator.metrics.protocol import OVERALL, TTC_RANGES
from evaluator.metrics.registry import MID
from evaluator.metrics.scale import FRAME_RATE_HZ, Floats
from evaluator.problems import reject
from evaluator.truth.annotations import FRAME_STEP_NS
from evaluator.truth.csv_tables import Table

STEP_S: Final = 1 / FRAME_RATE_HZ


@dataclass(frozen=True, slots=True)
class LabelNoise:
    """The noise of labels in a TTC range, or `overall`: MiD ×10⁻⁴, None without a pair.

    `jitter` is the mean difference between a label and its prediction from the one before, `noise` the mean
    error of a label that explains it.
    """

    name: str
    n_pairs: int
    jitter: float | None
    noise: float | None


def successive(table: Table) -> tuple[Floats, Floats]:
    """Pair each vehicle's labels 0.1 s apart, earlier and later seconds (n,); raises `Rejected` if none."""
    track_of = {
        key: number
        for number, key in enumerate(
            dict.fromkeys(zip(table.bag_stamp, table.cam_id, table.track_id, strict=True))
        )
    }
    keys = zip(table.bag_stamp, table.cam_id, table.track_id, strict=True)
    track = np.array([track_of[key] for key in keys])
    ts_ns, ttc_s = np.array(table.ts_ns, dtype=np.int64), np.array(table.ttc_s)
    order = np.lexsort((ts_ns, track))
    follows = (np.diff(track[order]) == 0) & (np.diff(ts_ns[order]) == FRAME_STEP_NS)
    if not follows.any():
        message = (
            "No two labels of a vehicle are 0.1 s apart; expected the labels of successive frames, as in an "
            "annotation folder, or from `tsttc baseline annotate --overlapping`."
        )
        raise reject("empty", message)
    return ttc_s[order[:-1][follows]], ttc_s[order[1:][follows]]


def successive_in_sequences(frame_ttc_s: Sequence[Sequence[float]]) -> tuple[Floats, Floats]:
    """Pair successive labels of sequences (m, 6), NaN if absent; raises `Rejected` if none."""
    frames = np.array(frame_ttc_s, dtype=np.float64)
    earlier, later = frames[:, :-1].ravel(), frames[:, 1:].ravel()
    there = np.isfinite(earlier) & np.isfinite(later)
    if not there.any():
        message = "No two successive frames have a true time to contact; expected one for every frame."
        raise reject("empty", message)
    return earlier[there], later[there]


def label_noise(earlier_s: Floats, later_s: Floats, *, n_frames: int = 10) -> list[LabelNoise]:
    """Compute the noise of labels whose velocities use `n_frames` frames, by TTC range."""
    # Pairs close to contact, without a MiD, do not count.
    jitter = MID.errors(earlier_s - STEP_S, later_s)
    is_defined = np.isfinite(jitter)
    jitter, later_s = jitter[is_defined], later_s[is_defined]
    ranges = [(OVERALL, -math.inf, math.inf), *((r.name, r.low_s, r.high_s) for r in TTC_RANGES)]
    noises = []
    for name, low_s, high_s in ranges:
        inside = jitter[(later_s >= low_s) & (later_s <= high_s)]
        mean = float(inside.mean()) if inside.size else None
        noise = None if mean is None else mean / jitter_of_noise(n_frames)
        noises.append(LabelNoise(name, int(inside.size), mean, noise))
    return noises


def jitter_of_noise(n_frames: int) -> float:
    """Compute the jitter for a noise of 1: √(2 (1 − ρ)), ρ the correlation of successive labels.

    Slopes of least-squares lines through q frames, with weights a_k = k − (q−1)/2, have
    ρ = Σ a_k a_(k+1) / Σ a_k². One frame means independent labels.

    >>> [round(jitter_of_noise(q), 3) for q in (1, 3, 5, 10)]
    [1.414, 1.414, 1.095, 0.775]
    """
    weights = np.arange(n_frames) - (n_frames - 1) / 2
    total = float(np.square(weights).sum())
    correlation = float((weights[:-1] * weights[1:]).sum()) / total if total else 0.0
    return math.sqrt(2 * (1 - correlation))
