"""Why values without a confidence interval have none, as pages, the API and files say it."""

from collections.abc import Mapping
from dataclasses import replace

from evaluator.metrics.protocol import OVERALL, split_name
from evaluator.tables import sentences
from leaderboard.boards.rows import ConfidenceInterval
from leaderboard.models import Edition
from leaderboard.statistics import confidence


def explained(
    intervals: Mapping[str, ConfidenceInterval], scores: Mapping[str, float | None], *, edition: Edition
) -> Mapping[str, ConfidenceInterval]:
    """Return the intervals of a row by score name, each without ends with its reason.

    Unchanged where they are still to be computed.
    """
    known = {name for name, each in intervals.items() if each.low is not None}
    missing = {name: value for name, value in scores.items() if value is not None and name not in known}
    if not missing or (not known and not confidence.why_no_interval(edition)):
        return intervals
    truth = edition.ground_truth
    counts = {OVERALL: truth.n_sequences, **truth.counts}
    of_missing = {
        name: replace(
            intervals.get(name, ConfidenceInterval()),
            reason=sentences.why_no_interval(
                name,
                value,
                n_sequences=counts.get(split_name(name)[1]),
                decimals=edition.decimals,
                n_effective=edition.n_effective.get(name, float(edition.unit_count)),
                unit=edition.unit,
            ),
        )
        for name, value in missing.items()
    }
    together = {**intervals, **of_missing}
    return {name: together[name] for name in scores if name in together}
