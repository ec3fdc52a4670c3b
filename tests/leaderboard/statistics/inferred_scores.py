"""Intervals and rank ranges that workers wrote with the scores."""

from dataclasses import asdict, dataclass

from evaluator.metrics.protocol import score_name
from leaderboard.boards.rows import ConfidenceInterval, ranges_in, scored_in
from leaderboard.models import Edition, EditionRanges, Evaluation, Score, Submission

INFERRED = ("low", "high", "rank_low", "rank_high", "is_with_best")


@dataclass(frozen=True)
class Inferred(ConfidenceInterval):
    """A score's value with what was inferred of it."""

    pk: int = 0
    value: float = 0.0


def scores_of(submission: Submission, edition: Edition) -> dict[str, Inferred]:
    evaluation = Evaluation.objects.get(submission=submission, edition=edition)
    intervals = scored_in(edition, ranges=ranges_in(edition))[evaluation.pk].intervals
    return {
        name: Inferred(**asdict(interval), pk=row.pk, value=row.value)
        for row in Score.objects.filter(evaluation=evaluation)
        for name in [score_name(row.metric, row.ttc_range)]
        for interval in [intervals.get(name, ConfidenceInterval())]
    }


def everything() -> list[tuple[object, ...]]:
    """All that was ever inferred, to be compared byte for byte: one row for each score, by its id."""
    ranges = dict(EditionRanges.objects.values_list("edition", "ranges"))
    rows = []
    for row in Score.objects.select_related("evaluation__edition").order_by("pk"):
        names = row.evaluation.edition.rules.score_names
        columns = ranges.get(row.evaluation.edition_id, {}).get(str(row.evaluation_id))
        pair = columns[names.index(score_name(row.metric, row.ttc_range))] if columns else None
        rows.append((row.pk, row.low, row.high, *(pair or (None, None))))
    return rows


def put_ranges(submission: Submission, **of: tuple[int, int]) -> None:
    """Write ranges by score name, as if a worker had."""
    evaluation = Evaluation.objects.select_related("edition").get(submission=submission)
    names = evaluation.edition.rules.score_names
    row = EditionRanges.objects.get(edition=evaluation.edition)
    for name, pair in of.items():
        row.ranges[str(evaluation.pk)][names.index(name)] = list(pair)
    row.save()
