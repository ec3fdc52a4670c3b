"""The confidence intervals of one set of predictions, as a board shows them."""

from __future__ import annotations

import numpy as np

from evaluator.metrics.protocol import DEFAULT_PROTOCOL, Protocol, ProtocolName, get_protocol
from evaluator.predictions.loading import Predictions
from evaluator.scoring.results import RecordingSums
from evaluator.scoring.scores import Scorer
from evaluator.scoring.uncertainty import bootstrap_of, by_units
from evaluator.truth.ground_truth import GroundTruth
from evaluator.units import UnitKind


def recording_sums(
    predictions: Predictions, truth: GroundTruth, *, protocol: ProtocolName | Protocol = DEFAULT_PROTOCOL
) -> RecordingSums:
    """Sum errors per recording; raises as `evaluate` does."""
    rules = get_protocol(protocol) if isinstance(protocol, str) else protocol
    bags = Scorer(truth, rules).report(predictions, keep_bags=True).bags
    assert bags is not None  # noqa: S101 - they were asked for
    return bags


def confidence_intervals(
    predictions: Predictions,
    truth: GroundTruth,
    *,
    protocol: ProtocolName | Protocol = DEFAULT_PROTOCOL,
    unit: UnitKind | None = None,
) -> dict[str, tuple[float, float] | None]:
    """Compute the 95% interval of each score as the board shows it; None if the board shows none.

    `unit` is recording, day or given; None takes `truth.manifest.units`. Raises `ValueError` for a unit that
    the recordings lack.
    """
    rules = get_protocol(protocol) if isinstance(protocol, str) else protocol
    units = truth.manifest.units_by(unit)
    bags = recording_sums(predictions, truth, protocol=rules)
    sums, counts = (by_units(each, units) for each in (bags.sums, bags.counts))
    low, high = (ends[0] for ends in bootstrap_of(truth.digest, counts).intervals(sums[None]))
    return {
        name: (float(low[i]), float(high[i])) if np.isfinite(low[i]) else None
        for i, name in enumerate(rules.score_names)
    }
