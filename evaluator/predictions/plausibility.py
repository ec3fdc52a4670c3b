"""Warnings about well-formed files that probably have another unit, sign or order."""

# Values are compared by the rank of -1/τ, the order of scale ratios: outliers have no weight.

from __future__ import annotations

import math
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluator.metrics.scale import Floats
from evaluator.predictions.loading import Predictions
from evaluator.problems import FileWarning
from evaluator.truth.ground_truth import GroundTruth, Manifest

MAX_STEP_NS: Final = 1_000_000_000
"""Windows of one track that end this close together are neighbours; in the dataset they are 0.6 s apart."""

MIN_PAIRS: Final = 100
"""With fewer pairs of either kind nothing is said."""

MAX_ROUGHNESS: Final = 0.8
MIN_CORRELATION: Final = 0.3
MAX_FLIPPED: Final = 0.3

MIN_VALUES: Final = 20
"""Of fewer values nothing is said, neither of their unit nor beside true ones."""

MIN_SHARE: Final = 0.99
"""Of the values that look like another unit."""

FAR_S: Final = 20.0
RATIOS: Final = (0.5, 1.5)
NEAR_S: Final = 10.0
"""Beyond it, noise decides whether a value rises or falls."""
MAX_RISING: Final = 0.7

Pairs = NDArray[np.intp]


def warnings_of(predictions: Predictions) -> list[FileWarning]:
    """Warn of a file by its manifest, without true values."""
    manifest, ttc_s = predictions.manifest, predictions.ttc_s
    return [*unit_warnings(ttc_s), *_sign_warnings(manifest, ttc_s), *_order_warnings(manifest, ttc_s)]


def unit_warnings(ttc_s: Floats) -> list[FileWarning]:
    """Warn of values (n,) that look like another unit than seconds."""
    n = len(ttc_s)
    if n < MIN_VALUES:
        return []
    n_far = int(np.count_nonzero(np.abs(ttc_s) > FAR_S))
    n_ratios = int(np.count_nonzero((ttc_s >= RATIOS[0]) & (ttc_s <= RATIOS[1])))
    if n_far >= MIN_SHARE * n:
        message = (
            f"{n_far:,} of {n:,} values lie beyond ±20 s; expected most of them within ±20 s. They are "
            "probably milliseconds, or scale ratios of a frame gap that is not the one in the file."
        )
        return [FileWarning("not-seconds", message)]
    if n_ratios >= MIN_SHARE * n:
        message = (
            f"{n_ratios:,} of {n:,} values lie between 0.5 and 1.5 s; expected few. They are probably scale "
            'ratios: these need "unit": "scale_ratio" and fps or frame_gap beside them.'
        )
        return [FileWarning("looks-like-ratios", message)]
    return []


def _sign_warnings(manifest: Manifest, ttc_s: Floats) -> list[FileWarning]:
    first, second = (ttc_s[rows] for rows in _pairs(manifest)[0].T)
    near = (np.sign(first) == np.sign(second)) & (np.abs(first) <= NEAR_S) & (np.abs(second) <= NEAR_S)
    n_rising = int(np.count_nonzero(near & (second > first)))
    n = n_rising + int(np.count_nonzero(near & (second < first)))
    if n < MIN_PAIRS or n_rising <= MAX_RISING * n:
        return []
    message = (
        f"The signs look flipped: from one window of an object to the next, {n_rising:,} of {n:,} values "
        "rise; expected most of them to fall, as a time to contact does while time passes. Probably every "
        "sign is wrong: τ is negative when the object moves away."
    )
    return [FileWarning("flipped-signs", message)]


def _order_warnings(manifest: Manifest, ttc_s: Floats) -> list[FileWarning]:
    jump_ratio = roughness(manifest, ttc_s)
    if jump_ratio is None or jump_ratio <= MAX_ROUGHNESS:
        return []
    message = (
        "The predictions seem to be in another order than the sequences. Successive predictions for one "
        "object should be similar, but they differ about as much as those for different objects (ratio "
        f"{jump_ratio:.2f}; expected at most {MAX_ROUGHNESS}). {_CAUSE}"
    )
    return [FileWarning("shuffled-values", message)]


def warnings_with_truth(predictions: Predictions, truth: GroundTruth) -> list[FileWarning]:
    """Compare values with the ground truth. The warnings reveal it, so hidden truths must not be used."""
    return [*unit_warnings(predictions.ttc_s), *_truth_warnings(predictions, truth)]


def _truth_warnings(predictions: Predictions, truth: GroundTruth) -> list[FileWarning]:
    predicted, true = order_of(predictions.ttc_s), order_of(truth.ttc_s)
    if truth.n_sequences < MIN_VALUES or predicted.std() == 0 or true.std() == 0:
        return []
    correlation = float(np.corrcoef(predicted, true)[0, 1])
    flipped = float(np.mean((predictions.ttc_s < 0) != (truth.ttc_s < 0)))
    has_both_signs = bool((predictions.ttc_s < 0).any() and (predictions.ttc_s > 0).any())
    if correlation >= MIN_CORRELATION and not (has_both_signs and flipped > MAX_FLIPPED):
        return []
    inverse = order_of(1 / predictions.ttc_s)
    cause = _CAUSE
    if flipped > MAX_FLIPPED and correlation < -MIN_CORRELATION:
        cause = "Probably every sign is wrong: τ is negative when the object moves away."
    elif flipped <= MAX_FLIPPED and float(np.corrcoef(inverse, true)[0, 1]) >= MIN_CORRELATION:
        cause = "Probably the values are inverse times, 1/τ; expected seconds."
    message = (
        f"The predictions hardly match the true times: their rank correlation is {correlation:.2f}, and "
        f"{100 * flipped:.0f}% have the opposite sign; expected at least {MIN_CORRELATION} and at most "
        f"{100 * MAX_FLIPPED:.0f}%. {cause}"
    )
    return [FileWarning("unlike-truth", message)]


_CAUSE: Final = (
    "Probably the anno_ids are those of the dataset's toolkit, which differ between machines. To write "
    "natural keys instead, run: tsttc convert FILE --annotations FOLDER -o OUT"
)


def roughness(manifest: Manifest, ttc_s: Floats) -> float | None:
    """Compare rank differences of neighbouring windows of one object with those of two objects."""
    # 1 means that values are unrelated to their keys; smooth values give well below 1.
    same, other = _pairs(manifest)
    if min(len(same), len(other)) < MIN_PAIRS:
        return None
    ranks = order_of(ttc_s)
    apart = _mean_difference(ranks, other)
    return _mean_difference(ranks, same) / apart if apart > 0 else None


def order_of(ttc_s: Floats) -> Floats:
    """Rank values by scale ratio, float64 (n,), ties at their mean."""
    with np.errstate(divide="ignore", over="ignore"):
        _, index, counts = np.unique(-1 / ttc_s, return_inverse=True, return_counts=True)
    ends = np.cumsum(counts)
    means: Floats = (ends - (counts - 1) / 2)[index]
    return means


def _mean_difference(ranks: Floats, pairs: Pairs) -> float:
    mean = float(np.abs(ranks[pairs[:, 0]] - ranks[pairs[:, 1]]).mean())
    return mean if math.isfinite(mean) else 0.0


@lru_cache(maxsize=4)  # by the manifest itself, which every file of a split shares
def _pairs(manifest: Manifest) -> tuple[Pairs, Pairs]:
    cameras = _numbered([f"{b}/{c}" for b, c in zip(manifest.bag_stamp, manifest.cam_id, strict=True)])
    tracks = _numbered(list(manifest.track_id))
    by_track = np.lexsort((manifest.ts_ns, tracks, cameras))
    by_time = np.lexsort((tracks, manifest.ts_ns, cameras))

    def successive(order: NDArray[np.intp], *, of_one_track: bool) -> Pairs:
        first, second = order[:-1], order[1:]
        is_near = manifest.ts_ns[second] - manifest.ts_ns[first] <= MAX_STEP_NS
        is_pair = is_near & (cameras[first] == cameras[second])
        is_pair &= (tracks[first] == tracks[second]) == of_one_track
        return np.stack([first[is_pair], second[is_pair]], axis=1)

    return successive(by_track, of_one_track=True), successive(by_time, of_one_track=False)


def _numbered(names: list[str]) -> NDArray[np.intp]:
    _, index = np.unique(np.array(names), return_inverse=True)
    return index
