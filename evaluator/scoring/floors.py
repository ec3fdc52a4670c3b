"""The floor of a board: what the ground truth itself scores, submitted as predictions.

It is not 0, because a protocol truncates predictions and not the truth: a sequence at 40 s is compared with
at most 20 s. Truncation moves the true value to the nearest boundary, so no file scores less in any column.
"""

from __future__ import annotations

from collections.abc import Mapping

from evaluator.predictions import Predictions
from evaluator.protocol import DEFAULT_PROTOCOL, SCORE_NAMES, Protocol
from evaluator.report import format_published
from evaluator.scoring import evaluate
from evaluator.truth import GroundTruth

_LABELS = {"mid": ("MiD", ""), "rte": ("RTE", " %")}


def floor_of(truth: GroundTruth, *, protocol: str | Protocol = DEFAULT_PROTOCOL) -> dict[str, float | None]:
    """The ten scores of the ground truth itself; None for an interval without sequences."""
    predictions = Predictions.from_arrays(ttc_s=truth.ttc_s, manifest=truth.manifest)
    return evaluate(predictions, truth, protocol=protocol).flat()


def floor_sentence(floor: Mapping[str, float | None] | None, *, decimals: int = 2) -> str:
    """The floor in words, from its published values; empty where it is not known, or 0 in every column.

    >>> print(floor_sentence({"mid": 0.36, "mid_crucial": 0.0, "rte": 0.73, "rte_crucial": 0.02}))
    Floor: the ground truth itself, submitted as predictions, scores MiD 0.36, RTE 0.73 %, RTE on crucial \
0.02 % and 0 in every other column. No file can score lower, because the protocol truncates predictions and \
not the ground truth.
    """
    if not floor or not any(floor.values()):
        return ""
    values = {name: floor[name] for name in SCORE_NAMES if floor.get(name) is not None}
    shown = [name for name, value in values.items() if value or name in _LABELS]
    parts = []
    for name in shown:
        metric, _, interval = name.partition("_")
        label, unit = _LABELS[metric]
        column = f"{label} on {interval}" if interval else label
        parts.append(f"{column} {format_published(values[name], decimals=decimals)}{unit}")
    rest = " and 0 in every other column" if len(shown) < len(values) else ""
    return (
        f"Floor: the ground truth itself, submitted as predictions, scores {', '.join(parts)}{rest}. No file "
        "can score lower, because the protocol truncates predictions and not the ground truth."
    )
