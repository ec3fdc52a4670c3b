"""The result of one evaluation, and the one way in which a number is rounded."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass

from evaluator.metrics.protocol import OVERALL, score_name
from evaluator.metrics.scale import Floats


@dataclass(frozen=True, slots=True)
class IntervalScore:
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


@dataclass(frozen=True, slots=True)
class Report:
    """What the predictions scored: means per TTC range, counts, and what was truncated at which boundary.

    `scores` runs as the protocol's `interval_names`: overall, crucial, …; `n_out_of_range` counts the
    sequences that lie in no range. Only on request, and no part of the JSON: `sequences`, by metric the
    errors of every sequence, float64 (n,) in the manifest's order, and `bags`. For a hidden split neither
    leaves the worker.
    """

    protocol: str
    truth_digest: str
    predictions_digest: str
    n_sequences: int
    n_out_of_range: int
    truncated: Mapping[str, int]
    scores: Mapping[str, IntervalScore]
    sequences: Mapping[str, Floats] | None = None
    bags: RecordingSums | None = None

    def as_dict(self) -> dict[str, object]:
        """The report as plain data, in the shape of `tsttc score --json`."""
        return {
            "protocol": self.protocol,
            "truth_digest": self.truth_digest,
            "predictions_digest": self.predictions_digest,
            "n_sequences": self.n_sequences,
            "n_out_of_range": self.n_out_of_range,
            "truncated": dict(self.truncated),
            "scores": {name: score.as_dict() for name, score in self.scores.items()},
        }

    def to_json(self) -> str:
        """The text of `as_dict()`, every float64 at full precision."""
        return json.dumps(self.as_dict(), allow_nan=False)

    def flat(self) -> dict[str, float | None]:
        """The numbers under the protocol's `score_names`, in that order."""
        return {
            score_name(metric, interval): score.means[metric]
            for metric in self.scores[OVERALL].means
            for interval, score in self.scores.items()
        }


def published(value: float | None, *, decimals: int = 2) -> float | None:
    """`value` as it is published: correctly rounded, half to even on its exact binary value. None stays None.

    >>> published(14.296), published(0.125), published(None)
    (14.3, 0.12, None)
    """
    if value is None:
        return None
    if not math.isfinite(value):
        raise ValueError(f"Only finite numbers are published; found {value}.")
    return round(float(value), decimals) + 0.0  # adding 0 turns -0.0 into 0.0


def format_published(value: float | None, *, decimals: int = 2, missing: str = "–") -> str:
    """The text of the published value with all its decimals, or `missing`.

    >>> format_published(14.296), format_published(None)
    ('14.30', '–')
    """
    rounded = published(value, decimals=decimals)
    return missing if rounded is None else f"{rounded:.{decimals}f}"
