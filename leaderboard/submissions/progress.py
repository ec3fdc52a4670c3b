"""The state of a submission: position in the queue, scores or problems."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, timedelta

from leaderboard.boards.rows import ConfidenceInterval, scored_of
from leaderboard.db import clock
from leaderboard.models import Evaluation, Status, Submission
from leaderboard.submissions import status_text

# A file is scored within a second; one that has waited for longer than this has met a fault.
LATE_AFTER = timedelta(minutes=1)


@dataclass(frozen=True)
class Progress:
    """What its team sees of a submission."""

    state: str
    received_at: datetime
    queued_at: datetime | None = None
    started_at: datetime | None = None
    finished_at: datetime | None = None
    n_ahead: int | None = None
    is_late: bool = False  # it takes longer than `LATE_AFTER`
    first_run: Evaluation | None = None  # in the first edition, where another edition's speaks for it
    scores: Mapping[str, float | None] | None = None
    intervals: Mapping[str, ConfidenceInterval] = field(default_factory=dict)  # by score name, where computed
    counts: Mapping[str, int] = field(default_factory=dict)
    truncated: Mapping[str, int] = field(default_factory=dict)
    n_out_of_range: int | None = None
    warnings: list[dict[str, str]] = field(default_factory=list)  # of a scored file: code and message
    problems: list[dict[str, str]] = field(default_factory=list)
    n_problems: int = 0
    fault_is_ours: bool = False
    sentence: str = ""
    is_final: bool = False
    edition_number: int | None = None
    protocol: str = ""
    decimals: int = 2  # of its values
    kept_in: int | None = None  # rejected here: the number of the last published edition that scored it


def evaluation_of(submission: Submission) -> Evaluation:
    """Return the evaluation in the published edition, else the latest, drafts last."""
    published = submission.split.current_edition_id
    evaluations = sorted(
        submission.evaluations.all(),
        key=lambda each: (each.edition.published_at is not None, each.edition.number),
    )
    return next((e for e in evaluations if e.edition_id == published), evaluations[-1])


def _first_run(submission: Submission, speaking: Evaluation) -> Evaluation | None:
    first = min(submission.evaluations.all(), key=lambda each: each.edition.number)
    if first.pk == speaking.pk or first.finished_at is None:
        return None
    # A failed run may be retried after a later edition has scored the file; then it is not what came first.
    return first if speaking.finished_at is None or first.finished_at <= speaking.finished_at else None


def progress_of(submission: Submission) -> Progress:
    evaluation = evaluation_of(submission)
    report = evaluation.report or {}
    rules, counts, truncated = evaluation.edition.rules, report.get("counts", {}), report.get("truncated", {})
    scored = scored_of(evaluation) if evaluation.status == Status.SCORED else None
    return Progress(
        state=evaluation.status,
        received_at=submission.submitted_at,
        queued_at=evaluation.queued_at,
        started_at=evaluation.started_at,
        finished_at=evaluation.finished_at,
        n_ahead=None if evaluation.is_final else _n_ahead(evaluation),
        is_late=not evaluation.is_final and _is_late(evaluation),
        first_run=_first_run(submission, evaluation),
        scores=scored.values if scored else None,
        intervals=scored.intervals if scored else {},
        # PostgreSQL gives JSON back in an order of its own.
        counts={name: counts[name] for name in rules.range_names if name in counts},
        truncated={name: truncated[name] for name in rules.boundaries if name in truncated},
        n_out_of_range=report.get("n_out_of_range"),
        warnings=report.get("warnings", []),
        problems=evaluation.problems,
        n_problems=evaluation.n_problems,
        fault_is_ours=evaluation.status == Status.SYSTEM_ERROR,
        sentence=status_text.sentence_of(evaluation),
        is_final=evaluation.is_final,
        edition_number=evaluation.edition.number,
        decimals=evaluation.edition.decimals,
        protocol=evaluation.edition.protocol,
        kept_in=evaluation.kept_in,
    )


def _n_ahead(evaluation: Evaluation) -> int:
    if evaluation.status != Status.QUEUED:
        return 0
    # One that waits for another try is not due yet, and comes after all that is.
    before = itertools.takewhile(evaluation.pk.__ne__, Evaluation.objects.due().values_list("pk", flat=True))
    return sum(1 for _ in before)


def _is_late(evaluation: Evaluation) -> bool:
    # Re-scoring goes in batches behind everything else: it may take its time.
    is_live = evaluation.priority == Evaluation.PRIORITY_LIVE
    return is_live and clock.database_now() - evaluation.queued_at > LATE_AFTER
