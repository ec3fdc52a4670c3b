"""The types that scoring returns, and the one way in which a number is rounded."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from evaluator.metrics.protocol import Protocol
from evaluator.metrics.scale import Floats
from evaluator.predictions.loading import Predictions
from evaluator.truth.ground_truth import GroundTruth


@dataclass(frozen=True, slots=True)
class RangeScore:
    """Mean errors over one TTC range, by metric. One without sequences has no value: None, never 0."""

    means: Mapping[str, float | None]
    count: int

    @property
    def mid(self) -> float | None:
        """The mean motion-in-depth error."""
        return self.means["mid"]

    @property
    def rte(self) -> float | None:
        """The mean relative TTC error."""
        return self.means["rte"]

    def as_dict(self) -> dict[str, float | int | None]:
        """The score as plain data. Written out: `dataclasses.asdict` copies for longer than scoring takes."""
        return {**self.means, "count": self.count}


@dataclass(frozen=True, slots=True, eq=False)
class RecordingSums:
    """Sums of errors per recording ("bag"), and how many sequences each sum has.

    Both are float64 (G, columns): the recordings as in `Manifest.recordings`, the columns as in the
    protocol's `score_names`. For a hidden split they never leave the worker.
    """

    sums: Floats
    counts: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Details:
    """The inputs and the errors of each sequence of a report; of a hidden split they never leave the worker.

    `predicted_ttc_s`, truncated by the protocol, and the `errors` by metric are (n,), in the truth's order.
    """

    truth: GroundTruth
    predictions: Predictions
    predicted_ttc_s: Floats
    errors: Mapping[str, Floats]
    protocol: Protocol


@dataclass(frozen=True, slots=True)
class GroupScores:
    """The scores of one group by their names: None where it has no sequence of a TTC range.

    `intervals` are the 95 % confidence intervals; None where there are too few days or recordings, or none
    were asked for.
    """

    group: str
    n_sequences: int
    n_recordings: int
    scores: Mapping[str, float | None]
    intervals: Mapping[str, tuple[float, float] | None]


def rounded(value: float | None, *, decimals: int = 2) -> float | None:
    """`value` as it is published: correctly rounded, half to even on its exact binary value. None stays None.

    >>> rounded(14.296), rounded(0.125), rounded(None)
    (14.3, 0.12, None)
    """
    if value is None:
        return None
    if not math.isfinite(value):
        raise ValueError(f"Only finite numbers are published; found {value}.")
    return round(float(value), decimals) + 0.0  # adding 0 turns -0.0 into 0.0


def format_rounded(value: float | None, *, decimals: int = 2, missing: str = "–") -> str:
    """The text of the published value with all its decimals, or `missing`.

    >>> format_rounded(14.296), format_rounded(None)
    ('14.30', '–')
    """
    shown = rounded(value, decimals=decimals)
    return missing if shown is None else f"{shown:.{decimals}f}"
