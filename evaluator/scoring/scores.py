"""Scoring: the metric specification of the TSTTC benchmark.

Errors of a sequence, from the true time to contact τ (seconds from the target frame, never truncated) and the
predicted τ̂ (truncated by the protocol), in float64:

    α₁₀(τ) = 1 / ((1/(τ·10) + 1) + 10⁻⁶)
    MiD    = |ln α₁₀(τ) − ln α₁₀(τ̂)| · 10⁴
    RTE    = |(τ̂ − τ) / τ| · 100 %

A score is the mean of an error over a range of the *true* τ; `overall` is the mean over all sequences,
also beyond ±20 s. `tsttc-1` truncates τ̂ to [−20, −0.15] ∪ [0.05, 20], by sign, so that α₁₀(τ̂) is within
[1/3, 3]. `toolkit` truncates to [−20, 20] and refuses τ̂ whose α₁₀ is not positive and finite, where the
dataset's toolkit crashes. Both refuse 0 and NaN, and truncate ±∞ to ±20.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from evaluator.arguments import require
from evaluator.metrics.protocol import (
    DEFAULT_PROTOCOL,
    OVERALL,
    Protocol,
    ProtocolName,
    column_words,
    get_protocol,
    known_names,
    metric_of,
    split_name,
)
from evaluator.metrics.registry import MID, Terms
from evaluator.metrics.scale import Floats, scale_ratio_10hz
from evaluator.predictions.loading import Predictions
from evaluator.predictions.revisions import realigned
from evaluator.predictions.values import allowed, broken_rule
from evaluator.problems import Findings
from evaluator.scoring.report import Report
from evaluator.scoring.results import Details, RangeScore, RecordingSums, format_rounded
from evaluator.truth.ground_truth import GroundTruth


def evaluate(
    predictions: Predictions,
    truth: GroundTruth,
    *,
    protocol: ProtocolName | Protocol = DEFAULT_PROTOCOL,
    keep_sequences: bool = False,
    keep_bags: bool = False,
) -> Report:
    """Score `predictions` against `truth`.

    `keep_sequences` keeps the errors of every sequence, `keep_bags` the sums per recording. Raises `Rejected`
    for values that the protocol forbids, `TypeError` for other objects, `ValueError` for an unknown protocol
    or another manifest.
    """
    rules = get_protocol(protocol) if isinstance(protocol, str) else protocol
    return Scorer(truth, rules).report(predictions, keep_sequences=keep_sequences, keep_bags=keep_bags)


class Scorer:
    """One truth under one protocol, ready for many predictions."""

    # In ascending τ a TTC range is a slice: sums over contiguous memory are fast, accurate (numpy adds
    # pairwise) and the same on every run.

    def __init__(self, truth: GroundTruth, protocol: Protocol) -> None:
        require(truth, GroundTruth, name="truth")
        self._truth = truth
        self._protocol = protocol
        tau = truth.ascending_ttc_s
        self._n_out_of_range = truth.n_outside(protocol.ranges)
        self._slices = {OVERALL: slice(0, len(tau))} | {
            i.name: slice(
                int(np.searchsorted(tau, i.low_s, side="right" if i.is_low_open else "left")),
                int(np.searchsorted(tau, i.high_s, side="left" if i.is_high_open else "right")),
            )
            for i in protocol.ranges
        }

    @cached_property
    def _recordings(self) -> NDArray[np.int64]:
        return self._truth.manifest.recording_index[self._truth.ascending_rows]

    @cached_property
    def recording_counts(self) -> Floats:
        n_bags = self._truth.manifest.n_recordings
        parts = [self._recordings[part] for part in self._slices.values()] * len(self._protocol.metrics)
        counts = np.stack([np.bincount(part, minlength=n_bags) for part in parts], axis=1)
        return counts.astype(np.float64)

    def _recording_sums(self, errors: Mapping[str, Floats]) -> RecordingSums:
        n_bags = self._truth.manifest.n_recordings
        columns = [
            np.bincount(self._recordings[part], weights=values[part], minlength=n_bags)
            for values in errors.values()
            for part in self._slices.values()
        ]
        return RecordingSums(sums=np.stack(columns, axis=1), counts=self.recording_counts)

    def report(
        self, predictions: Predictions, *, keep_sequences: bool = False, keep_bags: bool = False
    ) -> Report:
        """Score one set of predictions; raises as `evaluate` does."""
        require(predictions, Predictions, name="predictions")
        if predictions.manifest is not self._truth.manifest:
            if predictions.manifest.digest != self._truth.manifest.digest:
                raise ValueError(
                    "The predictions are aligned with another manifest than that of this ground truth."
                )
            # The same sequences, but the rows of the two files may have another order.
            predictions = realigned(predictions, manifest=self._truth.manifest)
        errors, n_truncated = self._errors(predictions)
        details = self._details(predictions, errors) if keep_sequences else None
        return Report(
            protocol=self._protocol.name,
            truth_digest=self._truth.digest,
            predictions_digest=predictions.digest,
            n_sequences=self._truth.n_sequences,
            n_out_of_range=self._n_out_of_range,
            truncated=dict(zip(self._protocol.boundaries, n_truncated, strict=True)),
            scores={name: self._score(errors, part) for name, part in self._slices.items()},
            sequences=details.errors if details else None,
            bags=self._recording_sums(errors) if keep_bags else None,
            details=details,
        )

    def _score(self, errors: Mapping[str, Floats], part: slice) -> RangeScore:
        count = part.stop - part.start
        if count == 0:
            return RangeScore(dict.fromkeys(errors), 0)
        means = {name: float(np.add.reduce(values[part])) / count for name, values in errors.items()}
        return RangeScore(means, count)

    def _details(self, predictions: Predictions, errors: Mapping[str, Floats]) -> Details:
        in_file_order = {name: np.empty_like(values) for name, values in errors.items()}
        for name, values in errors.items():
            in_file_order[name][self._truth.ascending_rows] = values
        predicted_ttc_s, _ = _truncate(predictions.ttc_s, self._protocol)
        return Details(self._truth, predictions, predicted_ttc_s, in_file_order, self._protocol)

    def _errors(self, predictions: Predictions) -> tuple[dict[str, Floats], tuple[int, ...]]:
        """Compute errors by metric in ascending τ, and the predictions truncated to each boundary."""
        truth = self._truth
        # Made with the first file of a truth, and better before the arrays below need memory too.
        true_log = truth.ascending_log_scale_ratio
        predicted, n_truncated = _truncate(predictions.ttc_s[truth.ascending_rows], self._protocol)
        alpha = scale_ratio_10hz(predicted)
        # Values that no file may hold may still come from arrays.
        is_allowed = allowed(predictions.ttc_s, unit="ttc").all()
        if not (is_allowed and _defined(alpha, self._protocol).all()):
            _refuse(predictions, self._protocol)
        terms = Terms(predicted, truth.ascending_ttc_s, alpha, true_log)
        errors = {metric.name: metric.function(terms) for metric in self._protocol.metrics}
        return errors, n_truncated


def _defined(scale_ratio: Floats, protocol: Protocol) -> NDArray[np.bool_]:
    """Whether each scale ratio has an error in every metric of the protocol: only MiD lacks some."""
    if MID not in protocol.metrics:
        return np.ones(scale_ratio.shape, dtype=bool)
    return np.asarray((scale_ratio > 0.0) & (scale_ratio < np.inf))


def _truncate(ttc_s: Floats, protocol: Protocol) -> tuple[Floats, tuple[int, ...]]:
    """Truncate to a new array, and count the changes per boundary; 0 and NaN stay."""
    limit_s = protocol.limit_s
    truncated = np.clip(ttc_s, -limit_s, limit_s)
    n_low, n_high = int(np.count_nonzero(ttc_s < -limit_s)), int(np.count_nonzero(ttc_s > limit_s))
    if protocol.near_zero_s is None:
        return truncated, (n_low, n_high)
    low_s, high_s = protocol.near_zero_s
    near = np.flatnonzero((ttc_s > low_s) & (ttc_s < high_s))
    values = ttc_s[near]
    truncated[near] = np.where(values < 0, low_s, np.where(values > 0, high_s, values))
    return truncated, (n_low, int(np.count_nonzero(values < 0)), int(np.count_nonzero(values > 0)), n_high)


def _refuse(predictions: Predictions, protocol: Protocol) -> NoReturn:
    findings = Findings()
    ttc_s, _ = _truncate(predictions.ttc_s, protocol)
    alpha = scale_ratio_10hz(ttc_s)
    is_good = allowed(predictions.ttc_s, unit="ttc") & _defined(alpha, protocol)
    for row in np.flatnonzero(~is_good).tolist():
        value, where = predictions.ttc_s[row], predictions.where(row)
        if rule := broken_rule(value, unit="ttc"):
            findings.add(rule.code, rule.message(value), where)
        else:
            message = (
                f"The value is {value!s} s, where the protocol {protocol.name} has no motion-in-depth error; "
                "expected a time to contact greater than 0, or at most -0.1."
            )
            findings.add("undefined-error", message, where)
    findings.raise_if_any()
    raise AssertionError("unreachable: the caller saw a forbidden value")


def floor_of(
    truth: GroundTruth, *, protocol: ProtocolName | Protocol = DEFAULT_PROTOCOL
) -> dict[str, float | None]:
    """Score the ground truth itself; None for an empty TTC range."""
    predictions = Predictions.from_arrays(ttc_s=truth.ttc_s, manifest=truth.manifest)
    return evaluate(predictions, truth, protocol=protocol).flat()


def floor_sentence(floor: Mapping[str, float | None] | None, *, decimals: int = 2) -> str:
    """Describe the floor by its published values; empty if it is unknown or 0 everywhere.

    >>> print(floor_sentence({"mid": 0.36, "mid_crucial": 0.0, "rte": 0.73, "rte_crucial": 0.02}))
    Floor: the ground truth itself, submitted as predictions, scores MiD 0.36, RTE 0.73%, RTE on crucial \
0.02% and 0 in every other column. This is about the lowest possible score: the protocol \
truncates predictions, but not the ground truth.
    """
    if not floor or not any(floor.values()):
        return ""
    values = {name: floor[name] for name in known_names() if floor.get(name) is not None}
    shown = [name for name, value in values.items() if value or split_name(name)[1] == OVERALL]
    texts = {name: format_rounded(values[name], decimals=decimals) for name in shown}
    parts = [f"{column_words(name)} {text}{metric_of(name).unit_of_value}" for name, text in texts.items()]
    rest = " and 0 in every other column" if len(shown) < len(values) else ""
    return (
        f"Floor: the ground truth itself, submitted as predictions, scores {', '.join(parts)}{rest}. This is "
        "about the lowest possible score: the protocol truncates predictions, but not the ground truth."
    )
