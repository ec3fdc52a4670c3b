"""The outcome of a submission for a reader: progress, rank, comparison with others."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from uuid import UUID

from django.db.models import QuerySet

from evaluator.metrics import registry
from evaluator.metrics.protocol import OVERALL, primary_value
from leaderboard.boards import snapshots
from leaderboard.boards.rows import ConfidenceInterval, Entry, profile_of, scored_of, submitted_entry
from leaderboard.boards.snapshots import CurrentBoard
from leaderboard.models import Edition, Evaluation, Score, Status, Submission, Visibility
from leaderboard.statistics import confidence
from leaderboard.submissions.progress import Progress, evaluation_of, progress_of

# How long pages say that intervals are about to come; they usually take a second or two.
AWAITED_FOR = timedelta(minutes=5)


@dataclass(frozen=True)
class BoardPosition:
    """The position of a scored submission on the present board."""

    edition: Edition
    rows: tuple[Entry, ...]  # everybody's
    rank: int | None = None  # None where another submission of its method is the row
    n_ranked: int = 0
    is_supposed: bool = False  # the method is private, and this is the rank that it would have
    intervals: Mapping[str, ConfidenceInterval] = field(default_factory=dict)
    best: frozenset[str] = frozenset()
    second: frozenset[str] = frozenset()


@dataclass(frozen=True)
class SubmissionView:
    """A submission with its progress and position."""

    submission: Submission
    progress: Progress
    position: BoardPosition | None
    awaits_intervals: bool  # scored a moment ago, and they are about to come

    @property
    def intervals(self) -> Mapping[str, ConfidenceInterval]:
        return published_intervals(self.progress, self.position)


def for_submissions(rows: Iterable[Submission], *, now: datetime) -> tuple[SubmissionView, ...]:
    """Return the views of these submissions, best fetched with evaluations, editions and scores."""
    pairs = [(submission, progress_of(submission)) for submission in rows]
    positions = _positions([each for each in pairs if _is_on_board(*each)])
    return tuple(
        SubmissionView(
            submission=submission,
            progress=progress,
            position=positions.get(submission.pk),
            awaits_intervals=awaits_intervals(submission, progress, now=now),
        )
        for submission, progress in pairs
    )


def board_position_of(submission: Submission, progress: Progress) -> BoardPosition | None:
    """Return the position of one submission; None unless it is in the published edition."""
    if not _is_on_board(submission, progress):
        return None
    return _positions([(submission, progress)]).get(submission.pk)


def can_be_withdrawn(submission: Submission) -> bool:
    """Tell whether withdrawing changes anything."""
    ends = {each.status for each in submission.evaluations.all()}
    return submission.withdrawn_at is None and not ends <= {Status.REJECTED, Status.CANCELLED}


# --- intervals -------------------------------------------------------------------------------------------


def has_intervals(progress: Progress) -> bool:
    return any(interval.low is not None for interval in progress.intervals.values())


def awaits_intervals(submission: Submission, progress: Progress, *, now: datetime) -> bool:
    """Tell whether the intervals of a scored submission are expected, until `AWAITED_FOR` later."""
    if not _is_on_board(submission, progress) or has_intervals(progress) or progress.finished_at is None:
        return False
    if now - progress.finished_at >= AWAITED_FOR:
        return False
    edition = evaluation_of(submission).edition
    return edition.discarded_at is None and not confidence.why_no_interval(edition)


def why_no_intervals(submission: Submission, progress: Progress, *, now: datetime) -> str:
    """Say why a scored submission has no confidence intervals; else empty."""
    if not _is_on_board(submission, progress) or has_intervals(progress):
        return ""
    if awaits_intervals(submission, progress, now=now):
        return "The confidence intervals are being computed."
    return confidence.why_no_interval(evaluation_of(submission).edition) or (
        "There are no confidence intervals yet. They are computed when no submission is waiting."
    )


def published_intervals(
    progress: Progress, position: BoardPosition | None
) -> Mapping[str, ConfidenceInterval]:
    """Return the confidence intervals, and rank ranges if it is a row of the present board."""
    return position.intervals if position else _without_ranges(progress.intervals)


def _without_ranges(intervals: Mapping[str, ConfidenceInterval]) -> dict[str, ConfidenceInterval]:
    return {
        name: ConfidenceInterval(low=interval.low, high=interval.high)
        for name, interval in intervals.items()
        if interval.low is not None
    }


# --- places ----------------------------------------------------------------------------------------------


def _is_on_board(submission: Submission, progress: Progress) -> bool:
    return progress.state == Status.SCORED and submission.withdrawn_at is None


def _positions(pairs: Sequence[tuple[Submission, Progress]]) -> dict[UUID, BoardPosition]:
    if not pairs:
        return {}
    wanted = {submission.split_id for submission, _ in pairs}
    boards = {
        split.pk: (split.current_edition, drawn)
        for split, drawn in snapshots.shown_on([each for each in snapshots.splits() if each.pk in wanted])
        if split.current_edition is not None
    }
    # In another edition than the present board's it has no position.
    pairs = [
        (submission, progress)
        for submission, progress in pairs
        if submission.split_id in boards and boards[submission.split_id][0].number == progress.edition_number
    ]
    private = {s.method_id for s, _ in pairs if s.method.visibility == Visibility.PRIVATE}
    best = _best_of(private, [edition for edition, _ in boards.values()]) if private else set()
    return {
        submission.pk: _position(submission, progress, *boards[submission.split_id], best=best)
        for submission, progress in pairs
    }


def _position(
    submission: Submission, progress: Progress, edition: Edition, drawn: CurrentBoard, *, best: set[UUID]
) -> BoardPosition:
    n_ranked = sum(row.rank is not None for row in drawn.entries)
    row = next((row for row in drawn.entries if row.submission_id == submission.pk), None)
    if row is not None:
        return BoardPosition(
            edition=edition,
            rows=drawn.entries,
            rank=row.rank,
            n_ranked=n_ranked,
            intervals=row.intervals,
            best=row.best,
            second=row.second,
        )
    position = BoardPosition(
        edition=edition, rows=drawn.entries, n_ranked=n_ranked, intervals=_without_ranges(progress.intervals)
    )
    if submission.pk not in best:
        return position
    rank = registry.rank([*(row.value for row in drawn.entries), primary_value(progress.scores)])[-1]
    return replace(position, rank=rank, n_ranked=n_ranked + 1, is_supposed=True)


def _best_of(methods: Iterable[UUID], editions: Iterable[Edition]) -> set[UUID]:
    best: dict[tuple[int, UUID], UUID] = {}
    by_metric: dict[str, list[Edition]] = {}
    for edition in editions:
        by_metric.setdefault(edition.rules.primary.name, []).append(edition)
    for metric, some in by_metric.items():
        rows = _ranking_scores(some, metric=metric).filter(evaluation__submission__method__in=methods)
        for edition_id, method, submission in rows.values_list(
            "evaluation__edition", "evaluation__submission__method", "evaluation__submission"
        ):
            best.setdefault((edition_id, method), submission)
    return set(best.values())


def _ranking_scores(editions: Iterable[Edition], *, metric: str) -> QuerySet[Score]:
    """Return the scores by which this metric ranks these editions, best first, then earliest."""
    return Score.objects.filter(
        evaluation__edition__in=list(editions),
        evaluation__status=Status.SCORED,
        evaluation__submission__withdrawn_at=None,
        metric=metric,
        ttc_range=OVERALL,
    ).order_by("value", "evaluation__submission__submitted_at")


# --- what is beside it -----------------------------------------------------------------------------------


def teams_best_other(submission: Submission, position: BoardPosition) -> Entry | None:
    """Return the team's best other entry on the same board, private ones included."""
    edition = position.edition
    others = _ranking_scores([edition], metric=edition.rules.primary.name).filter(
        evaluation__submission__method__team=submission.method.team_id
    )
    best_pk = others.exclude(evaluation__submission=submission).values_list("evaluation", flat=True).first()
    return _entry_of(Evaluation.objects.filter(pk=best_pk), position) if best_pk else None


def previous_of_method(submission: Submission, position: BoardPosition) -> Entry | None:
    """Return the scored submission of the same method before this one, on the same board."""
    earlier = Evaluation.objects.filter(
        edition=position.edition,
        status=Status.SCORED,
        submission__method=submission.method_id,
        submission__withdrawn_at=None,
        submission__submitted_at__lt=submission.submitted_at,
    )
    return _entry_of(earlier.order_by("-submission__submitted_at"), position)


def _entry_of(evaluations: QuerySet[Evaluation], position: BoardPosition) -> Entry | None:
    rows = evaluations.select_related("submission__method__team", "edition").prefetch_related("scores")
    evaluation = rows.first()
    if evaluation is None:
        return None
    entry = submitted_entry(
        evaluation,
        scored_of(evaluation),
        profile=profile_of(evaluation.submission.method),
        decimals=position.edition.decimals,
    )
    # What has ranges is a row of the board.
    shown = (row for row in position.rows if row.submission_id == entry.submission_id)
    return replace(entry, intervals=next((row.intervals for row in shown), entry.intervals))


def nearest_published(progress: Progress, position: BoardPosition) -> Entry | None:
    """Return the published result with the nearest score; of two as near the better one."""
    own = primary_value(progress.scores)
    near = [
        (abs(value - own), value, row)
        for row in position.rows
        if row.kind == "published" and own is not None and (value := row.value) is not None
    ]
    return min(near, key=lambda each: each[:2])[2] if near else None
