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
from evaluator.predictions.slopes import slope_of
from evaluator.problems import FileWarning, listed
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
SMALL_S: Final = 1.0
RATIOS: Final = (0.5, 1.5)
MIN_SHARE_OF_POSITIVE: Final = 0.9
"""Of scale ratios where no value is negative: of times to contact, some always are."""
MIN_VALUES_OF_BOTH_SIGNS: Final = 500
MIN_SHARE_OF_ONE_SIGN: Final = 0.999
"""Of so many values some have the other sign: in good files, at least 10% have."""
MIN_EQUAL_SHARE: Final = 0.5
MAX_INFINITE_SHARE: Final = 0.25

MIN_SLOPE: Final = 0.6
MAX_SLOPE: Final = 1.55
"""Good files lie between 0.83 and 1.04; the nearest mistakes are 0.52 (areas) and 1.73 (5/3 of the rate)."""
LEAST_SLOPE: Final = 0.05
"""Below it, values do not follow time at all, which is no mistake of the rate."""
MIN_INVERSE_SLOPE: Final = 0.35

MUCH_BETTER: Final = 0.2
MIN_SHIFT_S: Final = 0.3
TOLERANCE: Final = 0.1
"""In favour of a shift, where near and far times are compared: as a logarithm."""
MIN_RATIO: Final = 0.65
MAX_RATIO: Final = 1.55
SOON_S: Final = 6.0
"""True times up to it are compared: of far ones, the errors are large."""

MIN_CORRELATION_OF_RECORDING: Final = 0.1
MIN_UNLIKE_SHARE: Final = 0.01
"""Of recordings: in a few, far objects alone may hide what a poor method knows."""

NEAR_S: Final = 10.0
"""Beyond it, noise decides whether a value rises or falls."""
MAX_RISING: Final = 0.7

Pairs = NDArray[np.intp]


def warnings_of(predictions: Predictions) -> list[FileWarning]:
    """Warn of a file by its manifest, without true values."""
    manifest, ttc_s = predictions.manifest, predictions.ttc_s
    warnings = unit_warnings(ttc_s)
    if not any(warning.code == "constant-values" for warning in warnings):
        warnings += _order_warnings(manifest, ttc_s)
    # Values of another unit or another order have no slope that means anything.
    return warnings or _slope_warnings(predictions) or _small_warnings(ttc_s) or _one_sign_warnings(ttc_s)


def unit_warnings(ttc_s: Floats) -> list[FileWarning]:
    """Warn of values (n,) that look like another unit than seconds, or like no estimates."""
    if len(ttc_s) < MIN_VALUES:
        return []
    return [
        *_far_warnings(ttc_s),
        *_ratio_warnings(ttc_s),
        *_constant_warnings(ttc_s),
        *_infinite_warnings(ttc_s),
    ]


def _far_warnings(ttc_s: Floats) -> list[FileWarning]:
    n = len(ttc_s)
    n_far = int(np.count_nonzero((np.abs(ttc_s) > FAR_S) & np.isfinite(ttc_s)))
    n_finite = int(np.count_nonzero(np.isfinite(ttc_s)))
    if n_finite < MIN_VALUES or n_far < MIN_SHARE * n_finite:
        return []
    message = (
        f"{n_far:,} of {n:,} values lie beyond ±20 s; expected most of them within ±20 s. They are "
        "probably milliseconds, or scale ratios of a frame gap that is not the one in the file."
    )
    return [FileWarning("not-seconds", message)]


def _ratio_warnings(ttc_s: Floats) -> list[FileWarning]:
    n = len(ttc_s)
    has_one_sign = bool((ttc_s > 0).all() or (ttc_s < 0).all())
    sizes = np.abs(ttc_s) if has_one_sign else ttc_s
    n_ratios = int(np.count_nonzero((sizes >= RATIOS[0]) & (sizes <= RATIOS[1])))
    share = MIN_SHARE_OF_POSITIVE if has_one_sign else MIN_SHARE
    if n_ratios < share * n or len(np.unique(ttc_s)) == 1:
        return []
    bounds, kind = ("0.5 and 1.5", "scale") if ttc_s.max() > 0 else ("-1.5 and -0.5", "the negative of scale")
    message = (
        f"{n_ratios:,} of {n:,} values lie between {bounds} s; expected few. They are probably {kind} "
        'ratios: these need "unit": "scale_ratio" and fps or frame_gap beside them.'
    )
    return [FileWarning("looks-like-ratios", message)]


def _constant_warnings(ttc_s: Floats) -> list[FileWarning]:
    values, counts = np.unique(ttc_s, return_counts=True)
    n_equal, value = int(counts.max()), float(values[counts.argmax()])
    if n_equal < MIN_EQUAL_SHARE * len(ttc_s):
        return []
    message = (
        f"{n_equal:,} of {len(ttc_s):,} values are the same, {value:g} s; expected an estimate for each "
        "sequence. Probably the method gave no result, and a default value was written."
    )
    return [FileWarning("constant-values", message)]


def _infinite_warnings(ttc_s: Floats) -> list[FileWarning]:
    n_infinite = int(np.count_nonzero(np.isinf(ttc_s)))
    if n_infinite < MAX_INFINITE_SHARE * len(ttc_s) or len(np.unique(ttc_s)) == 1:
        return []
    message = (
        f"{n_infinite:,} of {len(ttc_s):,} values are infinite; expected few. Probably numbers were too "
        "large for their type, such as float16, or most scale ratios are exactly 1."
    )
    return [FileWarning("infinite-values", message)]


def _small_warnings(ttc_s: Floats) -> list[FileWarning]:
    n = len(ttc_s)
    n_small = int(np.count_nonzero(np.abs(ttc_s) <= SMALL_S))
    if n < MIN_VALUES or n_small < MIN_SHARE * n:
        return []
    message = (
        f"{n_small:,} of {n:,} values lie within ±1 s; expected few. They are probably no seconds, but "
        "probabilities, inverse times (1/τ), logarithms of scale ratios, or scale ratios minus 1."
    )
    return [FileWarning("within-one-second", message)]


def _one_sign_warnings(ttc_s: Floats) -> list[FileWarning]:
    n = len(ttc_s)
    n_positive = int(np.count_nonzero(ttc_s > 0))
    n_same = max(n_positive, n - n_positive)
    if n < MIN_VALUES_OF_BOTH_SIGNS or n_same < MIN_SHARE_OF_ONE_SIGN * n:
        return []
    sign, other = ("positive", "negative") if n_same == n_positive else ("negative", "positive")
    message = (
        f"{n_same:,} of {n:,} values are {sign}; expected some that are {other}. Probably the sign was lost: "
        "a time to contact is negative when the object moves away."
    )
    return [FileWarning("one-sign", message)]


def _slope_warnings(predictions: Predictions) -> list[FileWarning]:
    """Warn of times that do not fall by a second per second, and name the probable cause."""
    manifest, ttc_s = predictions.manifest, predictions.ttc_s
    slope, of_inverse = slope_of(manifest, ttc_s), slope_of(manifest, _inverse_of(ttc_s))
    if slope is None:
        return _sign_warnings(predictions, is_flipped=False)
    if of_inverse is not None and abs(slope.overall) < MIN_INVERSE_SLOPE:
        if of_inverse.is_above(MIN_INVERSE_SLOPE) and of_inverse.overall < MAX_SLOPE:
            return [_inverse_warning("inverse times, 1/τ")]
        if of_inverse.is_above(MAX_SLOPE) or of_inverse.is_below(-MIN_INVERSE_SLOPE):
            kinds = "logarithms of scale ratios, scale ratios minus 1, or inverse times of the other sign"
            return [_inverse_warning(kinds)]
    flipped = _sign_warnings(predictions, is_flipped=slope.is_below(-MIN_INVERSE_SLOPE))
    if flipped:
        return flipped
    if (slope.is_above(LEAST_SLOPE) and slope.is_below(MIN_SLOPE)) or slope.is_above(MAX_SLOPE):
        return [_rate_warning(slope.median, is_ratio=predictions.unit == "scale_ratio")]
    return []


def _inverse_of(ttc_s: Floats) -> Floats:
    with np.errstate(divide="ignore", over="ignore"):
        return 1 / ttc_s


def _inverse_warning(kinds: str) -> FileWarning:
    message = (
        "From one window of an object to the next, the values change as inverse times do; expected times to "
        f"contact, which fall by a second per second. Probably the values are {kinds}."
    )
    return FileWarning("inverse-times", message)


def _rate_warning(slope: float, *, is_ratio: bool) -> FileWarning:
    begin = (
        "From one window of an object to the next, the values fall by "
        f"{slope:.2f} s per second; expected about 1, as a time to contact does while time passes."
    )
    if slope < 1:
        cause = (
            "fps is too high or frame_gap too small for these scale ratios"
            if is_ratio
            else "the rate of the frame pair was too high when scale ratios became seconds"
        )
        return FileWarning(
            "wrong-rate", f"{begin} Probably {cause}, or the ratios are of areas, not lengths."
        )
    cause = (
        "fps is too low or frame_gap too large for these scale ratios"
        if is_ratio
        else "the rate of the frame pair was too low when scale ratios became seconds"
    )
    return FileWarning("wrong-rate", f"{begin} Probably {cause}, or the values count frames, not seconds.")


def _sign_warnings(predictions: Predictions, *, is_flipped: bool) -> list[FileWarning]:
    manifest, ttc_s = predictions.manifest, predictions.ttc_s
    first, second = (ttc_s[rows] for rows in _pairs(manifest)[0].T)
    near = (np.sign(first) == np.sign(second)) & (np.abs(first) <= NEAR_S) & (np.abs(second) <= NEAR_S)
    n_rising = int(np.count_nonzero(near & (second > first)))
    n = n_rising + int(np.count_nonzero(near & (second < first)))
    if n < MIN_PAIRS or n_rising <= (0.5 if is_flipped else MAX_RISING) * n:
        return []
    inverted = ", or the scale ratios are target / reference instead of reference / target"
    message = (
        f"The signs look flipped: from one window of an object to the next, {n_rising:,} of {n:,} values "
        "rise; expected most of them to fall, as a time to contact does while time passes. Probably every "
        "sign is wrong: τ is negative when the object moves away"
        f"{inverted if predictions.unit == 'scale_ratio' else ''}."
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
    warnings = [*unit_warnings(predictions.ttc_s), *_truth_warnings(predictions, truth)]
    if warnings:
        return warnings
    return [*_scale_warnings(predictions, truth), *_recording_warnings(predictions, truth)]


def _truth_warnings(predictions: Predictions, truth: GroundTruth) -> list[FileWarning]:
    true = order_of(truth.ttc_s)
    if truth.n_sequences < MIN_VALUES or true.std() == 0 or order_of(predictions.ttc_s).std() == 0:
        return []
    correlation, flipped = _likeness(predictions.ttc_s, truth.ttc_s)
    has_both_signs = bool((predictions.ttc_s < 0).any() and (predictions.ttc_s > 0).any())
    is_like = correlation >= MIN_CORRELATION and not (has_both_signs and flipped > MAX_FLIPPED)
    inverse = _inverse_of(predictions.ttc_s)
    # Where signs alone make them alike, another unit must match the truth far better to be named.
    best, cause = (correlation + MUCH_BETTER, "") if is_like else (MIN_CORRELATION, _CAUSE)
    for values, named in ((-predictions.ttc_s, _SIGNS), (inverse, _INVERSE), (-inverse, _LOGARITHMS)):
        likeness, n_opposite = _likeness(values, truth.ttc_s)
        if likeness > best and n_opposite <= MAX_FLIPPED:
            best, cause = likeness, named
    if not cause:
        return []
    message = (
        f"The predictions hardly match the true times: their rank correlation is {correlation:.2f}, and "
        f"{100 * flipped:.0f}% have the opposite sign; expected at least {MIN_CORRELATION} and at most "
        f"{100 * MAX_FLIPPED:.0f}%. {cause}"
    )
    return [FileWarning("unlike-truth", message)]


def _likeness(ttc_s: Floats, true_s: Floats) -> tuple[float, float]:
    """Return the rank correlation, and the share of values with the opposite sign."""
    return rank_correlation(ttc_s, true_s), float(np.mean((ttc_s < 0) != (true_s < 0)))


def rank_correlation(ttc_s: Floats, true_s: Floats) -> float:
    """Correlate the orders of two arrays (n,); 0 where one of them is constant."""
    predicted, true = order_of(ttc_s), order_of(true_s)
    if predicted.std() == 0 or true.std() == 0:
        return 0.0
    return float(np.corrcoef(predicted, true)[0, 1])


def _scale_warnings(predictions: Predictions, truth: GroundTruth) -> list[FileWarning]:
    """Warn of values that are all a factor, or all a fixed time, away from the true ones."""
    predicted, true = predictions.ttc_s, truth.ttc_s
    is_near = (np.abs(true) <= SOON_S) & (np.sign(predicted) == np.sign(true)) & np.isfinite(predicted)
    if np.count_nonzero(is_near) < MIN_VALUES:
        return []
    predicted, true = predicted[is_near], true[is_near]
    is_nearer = np.abs(true) <= np.median(np.abs(true))
    shifts = [float(np.median(predicted[rows] - true[rows])) for rows in (is_nearer, ~is_nearer)]
    shift = float(np.median(predicted - true))
    ratio = float(np.median(predicted / true))
    ratios = [float(np.median(predicted[rows] / true[rows])) for rows in (is_nearer, ~is_nearer)]
    is_factor = max(ratios) < MIN_RATIO or min(ratios) > MAX_RATIO
    if is_factor and _difference(ratios) < _difference(shifts):
        return [_factor_warning(ratio)]
    if abs(shift) >= MIN_SHIFT_S and _difference(shifts) <= _difference(ratios) + TOLERANCE:
        side = "late" if shift > 0 else "early"
        message = (
            f"The predicted times are {abs(shift):.2f} s too {side}, near and far alike (median of predicted "
            "minus true); expected about 0. Probably they are counted from another frame than the target: "
            "the reference frame of a pair with a gap of 5 is 0.50 s before it."
        )
        return [FileWarning("shifted-times", message)]
    return [_factor_warning(ratio)] if is_factor else []


def _difference(medians: list[float]) -> float:
    """Say how far the medians of near and of far times differ, as a logarithm; infinite for two signs."""
    near, far = medians
    return abs(math.log(far / near)) if near * far > 0 else math.inf


def _factor_warning(ratio: float) -> FileWarning:
    cause = (
        "fps is too high, frame_gap is too small, or the ratios are of areas, not lengths"
        if ratio < 1
        else "fps is too low, frame_gap is too large, or the values count frames, not seconds"
    )
    message = (
        f"The predicted times are {ratio:.2f} times the true ones (median of predicted / true); expected "
        f"about 1. Probably {cause}."
    )
    return FileWarning("wrong-rate", message)


def _recording_warnings(predictions: Predictions, truth: GroundTruth) -> list[FileWarning]:
    """Name the recordings in which the order of the values has nothing to do with that of the true times."""
    manifest = truth.manifest
    index = manifest.recording_index
    by_recording = np.split(np.argsort(index, kind="stable"), np.flatnonzero(np.diff(np.sort(index))) + 1)
    n_compared, unlike = 0, list[str]()
    for rows in by_recording:
        predicted, true = predictions.ttc_s[rows], truth.ttc_s[rows]
        if len(rows) < MIN_VALUES or len(np.unique(true)) < MIN_VALUES / 2:
            continue
        n_compared += 1
        if rank_correlation(predicted, true) < MIN_CORRELATION_OF_RECORDING:
            unlike.append(manifest.bag_stamp[int(rows[0])])
    if not unlike or len(unlike) < MIN_UNLIKE_SHARE * n_compared:
        return []
    message = (
        f"In {len(unlike):,} of {n_compared:,} recordings, the predictions have nothing to do with the true "
        f"times (rank correlation below {MIN_CORRELATION_OF_RECORDING}): {listed(unlike)}. Probably their "
        "values belong to other sequences, for example by the anno_ids of an earlier edition: "
        "tsttc convert FILE --manifest OLD.csv writes natural keys."
    )
    return [FileWarning("unlike-recordings", message)]


_SIGNS: Final = "Probably every sign is wrong: τ is negative when the object moves away."
_INVERSE: Final = "Probably the values are inverse times, 1/τ; expected seconds."
_LOGARITHMS: Final = (
    "Probably the values are logarithms of scale ratios, scale ratios minus 1, or inverse times of the other "
    "sign; expected seconds."
)
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
