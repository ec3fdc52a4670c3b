"""The floor of a board: what the ground truth itself scores, submitted as predictions.

It is not 0, because a protocol truncates predictions and not the truth: a sequence at 40 s is compared with
at most 20 s. Truncation moves the true value to the nearest boundary, so no file scores less in any column.
"""

from __future__ import annotations

from collections.abc import Mapping

from evaluator.metrics.protocol import (
    DEFAULT_PROTOCOL,
    OVERALL,
    Protocol,
    column_words,
    known_names,
    metric_of,
    split_name,
)
from evaluator.predictions.predictions import Predictions
from evaluator.scoring.report import format_published
from evaluator.scoring.scoring import evaluate
from evaluator.truth.truth import GroundTruth


def floor_of(truth: GroundTruth, *, protocol: str | Protocol = DEFAULT_PROTOCOL) -> dict[str, float | None]:
    """The scores of the ground truth itself; None for a TTC range without sequences."""
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
    values = {name: floor[name] for name in known_names() if floor.get(name) is not None}
    shown = [name for name, value in values.items() if value or split_name(name)[1] == OVERALL]
    texts = {name: format_published(values[name], decimals=decimals) for name in shown}
    parts = [f"{column_words(name)} {text}{metric_of(name).unit_of_value}" for name, text in texts.items()]
    rest = " and 0 in every other column" if len(shown) < len(values) else ""
    return (
        f"Floor: the ground truth itself, submitted as predictions, scores {', '.join(parts)}{rest}. No file "
        "can score lower, because the protocol truncates predictions and not the ground truth."
    )
