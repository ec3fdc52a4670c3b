"""All submissions with all their published numbers, for maintainers: a row for each evaluation."""

from collections.abc import Callable, Iterator, Mapping
from datetime import datetime
from typing import Final

from evaluator.metrics.protocol import known_names
from evaluator.scoring.results import format_rounded
from leaderboard.boards.rows import flat_scores
from leaderboard.models import Evaluation, Submission

_Fact = Callable[[Evaluation, Submission], object]
_FACTS: Final[Mapping[str, _Fact]] = {
    "submission": lambda _, submission: str(submission.pk),
    "split": lambda evaluation, _: evaluation.edition.split_id,
    "edition": lambda evaluation, _: evaluation.edition.number,
    "protocol": lambda evaluation, _: evaluation.edition.protocol,
    "ground_truth": lambda evaluation, _: evaluation.edition.ground_truth_id,
    "is_board": lambda evaluation, _: evaluation.edition.split.current_edition_id == evaluation.edition_id,
    "status": lambda evaluation, _: evaluation.status,
    "method_id": lambda _, submission: str(submission.method_id),
    "method": lambda _, submission: submission.method.name,
    "visibility": lambda _, submission: submission.method.visibility,
    "team_id": lambda _, submission: str(submission.method.team_id),
    "team": lambda _, submission: submission.method.team.name,
    "submitted_by": lambda _, submission: str(submission.submitted_by.pk),
    "submitted_at": lambda _, submission: submission.submitted_at,
    "finished_at": lambda evaluation, _: evaluation.finished_at,
    "withdrawn_at": lambda _, submission: submission.withdrawn_at,
    "hidden_at": lambda _, submission: submission.hidden_at,
    "via": lambda _, submission: submission.via,
    "file": lambda _, submission: submission.digest,
    "size_bytes": lambda _, submission: submission.size_bytes,
    "manifest": lambda _, submission: submission.manifest_digest,
}


def columns() -> tuple[str, ...]:
    return (*_FACTS, *known_names())


def rows(*, split: str = "", has_addresses: bool = False) -> Iterator[dict[str, object]]:
    """Yield a row for each evaluation, oldest submission first; None where there is no value.

    `submitted_by` is the number of the account, or its address with `has_addresses`.
    """
    evaluations = Evaluation.objects.select_related(
        "submission__method__team", "submission__submitted_by", "edition__split"
    ).prefetch_related("scores")
    if split:
        evaluations = evaluations.filter(edition__split=split)
    ordered = evaluations.order_by("submission__submitted_at", "submission", "edition__number")
    for evaluation in ordered.iterator(chunk_size=500):
        facts = {name: fact(evaluation, evaluation.submission) for name, fact in _FACTS.items()}
        row = {name: f.isoformat() if isinstance(f, datetime) else f for name, f in facts.items()}
        if has_addresses:
            row["submitted_by"] = evaluation.submission.submitted_by.email
        yield row | _numbers(evaluation)


def _numbers(evaluation: Evaluation) -> dict[str, object]:
    decimals = evaluation.edition.decimals
    texts = {
        name: format_rounded(value, decimals=decimals, missing="")
        for name, value in flat_scores(evaluation).items()
    }
    return {name: float(text) if text else None for name, text in texts.items()}
