"""What workers wrote beside the scores."""

from leaderboard.models import Edition, Score, Submission

INFERRED = ("low", "high", "rank_low", "rank_high", "is_with_best")


def scores_of(submission: Submission, edition: Edition) -> dict[str, Score]:
    rows = Score.objects.filter(evaluation__submission=submission, evaluation__edition=edition)
    return {row.metric if row.interval == "overall" else f"{row.metric}_{row.interval}": row for row in rows}


def everything() -> list[tuple[object, ...]]:
    """All that was ever inferred, to be compared byte for byte."""
    return list(Score.objects.order_by("pk").values_list("pk", *INFERRED))
