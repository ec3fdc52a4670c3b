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
    """Mean errors over one TTC range, by metric; values are None without sequences."""

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

    @property
    def warning(self) -> float | None:
        """The mean warning error; None if the protocol has none."""
        return self.means.get("warning")

    def as_dict(self) -> dict[str, float | int | None]:
        """Return the score as plain data."""
        # Written out, because `dataclasses.asdict` takes longer than scoring.
        return {**self.means, "count": self.count}


@dataclass(frozen=True, slots=True, eq=False)
class RecordingSums:
    """Sums of errors and numbers of sequences per recording, float64 (recordings, score names)."""

    # For a hidden split they never leave the worker.

    sums: Floats
    counts: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Details:
    """Inputs and errors of each sequence, (n,), in the truth's order; `predicted_ttc_s` is truncated."""

    # For a hidden split they never leave the worker.

    truth: GroundTruth
    predictions: Predictions
    predicted_ttc_s: Floats
    errors: Mapping[str, Floats]
    protocol: Protocol


@dataclass(frozen=True, slots=True)
class GroupScores:
    """The scores of one group by name, None where empty; `intervals` are at 95%, None if absent."""

    group: str
    n_sequences: int
    n_recordings: int
    scores: Mapping[str, float | None]
    intervals: Mapping[str, tuple[float, float] | None]


def rounded(value: float | None, *, decimals: int = 2) -> float | None:
    """Round `value` for publication: half to even on its exact binary value. None stays None.

    >>> rounded(14.296), rounded(0.125), rounded(None)
    (14.3, 0.12, None)
    """
    if value is None:
        return None
    if not math.isfinite(value):
        raise ValueError(f"Only finite numbers are published; found {value}.")
    return round(float(value), decimals) + 0.0  # adding 0 turns -0.0 into 0.0


def format_rounded(value: float | None, *, decimals: int = 2, missing: str = "–") -> str:
    """Format the published value with all its decimals, or `missing` for None.

    >>> format_rounded(14.296), format_rounded(None)
    ('14.30', '–')
    """
    shown = rounded(value, decimals=decimals)
    return missing if shown is None else f"{shown:.{decimals}f}"
