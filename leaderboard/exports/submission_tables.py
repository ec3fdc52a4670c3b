"""All submissions with all their numbers, for maintainers: a row for each evaluation.

The numbers are those that are published, with the decimals of their edition. Files and hidden values are not
among them. Addresses are there only if asked for.
"""

from collections.abc import Iterator
from typing import Final

from evaluator.metrics.protocol import known_names
from evaluator.scoring.report import format_published
from leaderboard.boards.rows import flat_scores
from leaderboard.models import Evaluation

_FACTS: Final = (
    "submission",
    "split",
    "edition",
    "protocol",
    "ground_truth",
    "is_board",
    "status",
    "method_id",
    "method",
    "visibility",
    "team_id",
    "team",
    "submitted_by",
    "submitted_at",
    "finished_at",
    "withdrawn_at",
    "hidden_at",
    "via",
    "file",
    "size_bytes",
    "manifest",
)


def columns() -> tuple[str, ...]:
    """The names of the columns, the scores of all protocols among them."""
    return (*_FACTS, *known_names())


def rows(*, split: str = "", has_addresses: bool = False) -> Iterator[dict[str, object]]:
    """A row for each evaluation, in the order in which submissions came; None where there is no value.

    `submitted_by` is the number of the account, or its address with `has_addresses`.
    """
    evaluations = Evaluation.objects.select_related(
        "submission__method__team", "submission__submitted_by", "edition__split"
    ).prefetch_related("scores")
    if split:
        evaluations = evaluations.filter(edition__split=split)
    ordered = evaluations.order_by("submission__submitted_at", "submission", "edition__number")
    for evaluation in ordered.iterator(chunk_size=500):
        yield _facts(evaluation, has_addresses=has_addresses) | _numbers(evaluation)


def _facts(evaluation: Evaluation, *, has_addresses: bool) -> dict[str, object]:
    submission, edition = evaluation.submission, evaluation.edition
    by = submission.submitted_by
    times = {
        "submitted_at": submission.submitted_at,
        "finished_at": evaluation.finished_at,
        "withdrawn_at": submission.withdrawn_at,
        "hidden_at": submission.hidden_at,
    }
    return {
        "submission": str(submission.pk),
        "split": edition.split_id,
        "edition": edition.number,
        "protocol": edition.protocol,
        "ground_truth": edition.ground_truth_id,
        "is_board": edition.split.published_edition_id == edition.pk,
        "status": evaluation.status,
        "method_id": str(submission.method_id),
        "method": submission.method.name,
        "visibility": submission.method.visibility,
        "team_id": str(submission.method.team_id),
        "team": submission.method.team.name,
        "submitted_by": by.email if has_addresses else str(by.pk),
        **{name: at.isoformat() if at else None for name, at in times.items()},
        "via": submission.via,
        "file": submission.digest,
        "size_bytes": submission.size_bytes,
        "manifest": submission.manifest_digest,
    }


def _numbers(evaluation: Evaluation) -> dict[str, object]:
    decimals = evaluation.edition.decimals
    texts = {
        name: format_published(value, decimals=decimals, missing="")
        for name, value in flat_scores(evaluation).items()
    }
    return {name: float(text) if text else None for name, text in texts.items()}
