"""What an edition in preparation would change, and what the published one changed."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import datetime
from typing import Any
from uuid import UUID

from django.contrib.auth.models import AnonymousUser

from leaderboard.boards import listing, snapshots
from leaderboard.boards.rows import scored_in
from leaderboard.editions import corrections, ground_truth, history
from leaderboard.errors.refusals import Refused
from leaderboard.models import Edition, Evaluation, Status, Submission

ABSENT = "ABSENT"  # not evaluated in that edition


@dataclass(frozen=True)
class Change:
    """An active submission in the published edition and in the one in preparation.

    It has a rank where it represents its method.
    """

    submission_id: UUID
    method: str
    team: str
    submitted_at: datetime
    is_seen_by_all: bool
    old_status: str
    new_status: str
    old: Mapping[str, float | None]
    new: Mapping[str, float | None]
    old_rank: int | None
    new_rank: int | None
    problems: tuple[Mapping[str, str], ...] = ()
    old_decimals: int = 2
    new_decimals: int = 2

    @property
    def delta(self) -> dict[str, float | None]:
        """Return new minus old scores; None where either is missing."""
        names = dict.fromkeys([*self.old, *self.new])
        return {name: _difference(self.old.get(name), self.new.get(name)) for name in names}

    @property
    def rank_change(self) -> int:
        """Return the change of rank; entries that leave or join the board sort first."""
        if self.old_rank is None or self.new_rank is None:
            return 0 if self.old_rank == self.new_rank else 10**6
        return abs(self.new_rank - self.old_rank)

    @property
    def is_changed(self) -> bool:
        """Tell whether its state, rank or any score changes; a score that neither edition has does not."""
        is_moved = (self.old_status, self.old_rank) != (self.new_status, self.new_rank)
        return is_moved or any(self.old.get(name) != self.new.get(name) for name in self.delta)


@dataclass(frozen=True)
class Preview:
    """All changes that publishing makes."""

    edition: Edition
    published: Edition  # which it replaces, or replaced
    changes: tuple[Change, ...]
    progress: corrections.RescoringProgress
    truth: history.TruthChange | None  # between the two; None if these were never compared

    @property
    def replaces(self) -> int:
        return self.published.number

    @property
    def names(self) -> tuple[str, ...]:
        rules = (self.published.rules, self.edition.rules)
        return tuple(dict.fromkeys(name for each in rules for name in each.score_names))

    @property
    def columns(self) -> tuple[str, ...]:
        return (
            *("submission", "method", "team", "old_status", "new_status", "old_rank", "new_rank"),
            *(f"{side}_{name}" for side in ("old", "new", "delta") for name in self.names),
            *("reason", "n_renumbered"),
        )

    @property
    def entries(self) -> tuple[Change, ...]:
        """Return submissions that either edition shows."""
        return tuple(
            change
            for change in self.changes
            if (change.old_status, change.new_status) != (Status.REJECTED, Status.REJECTED)
        )

    @property
    def n_changed(self) -> int:
        return sum(change.is_changed for change in self.changes)

    @property
    def n_moved(self) -> int:
        return sum(change.rank_change > 0 for change in self.changes)

    @property
    def n_newly_rejected(self) -> int:
        return sum(
            change.old_status == Status.SCORED and change.new_status == Status.REJECTED
            for change in self.changes
        )


def preview(edition: Edition) -> Preview:
    """Compare an edition with the published one, by change of rank. Raises `Refused` without one.

    The published edition is compared with the one that it replaced, or, as the first, with itself.
    """
    published = edition.split.current_edition
    if published is not None and published.pk == edition.pk:
        latest = history.latest_change(edition.split)
        published = (latest and latest.replaced) or published
    if published is None:
        raise Refused(
            "edition-refused", f"The split {edition.split_id!r} has no published edition to compare with."
        )
    old, new = _side(published), _side(edition)
    changes = [_change(submission, old, new) for submission in ground_truth.active_submissions(edition)]
    changes.sort(
        key=lambda c: (-c.rank_change, c.new_rank or 10**6, c.method.casefold(), str(c.submission_id))
    )
    return Preview(
        edition=edition,
        published=published,
        changes=tuple(changes),
        progress=corrections.progress(edition),
        truth=history.change_of_truth(published.ground_truth, edition.ground_truth),
    )


def rows(edition_preview: Preview) -> list[dict[str, Any]]:
    """Return flat rows for CSV and JSON, one for each submission.

    `n_renumbered` counts sequences with another anno_id than before, the same in all rows.
    """
    return [
        {
            "submission": str(change.submission_id),
            "method": change.method,
            "team": change.team,
            "old_status": change.old_status,
            "new_status": change.new_status,
            "old_rank": change.old_rank,
            "new_rank": change.new_rank,
            **{f"old_{name}": change.old.get(name) for name in edition_preview.names},
            **{f"new_{name}": change.new.get(name) for name in edition_preview.names},
            **{f"delta_{name}": value for name, value in change.delta.items()},
            "reason": change.problems[0]["message"] if change.problems else "",
            "n_renumbered": edition_preview.truth.n_renumbered if edition_preview.truth else None,
        }
        for change in edition_preview.changes
    ]


def document(edition_preview: Preview) -> dict[str, Any]:
    """Return totals, progress and the flat rows as one JSON document."""
    truth, progress = edition_preview.truth, edition_preview.progress
    return {
        "edition": edition_preview.edition.number,
        "replaces": edition_preview.replaces,
        "n_added": truth.n_added if truth else None,
        "n_removed": truth.n_removed if truth else None,
        "n_changed_sequences": truth.n_changed if truth else None,
        "n_renumbered": truth.n_renumbered if truth else None,
        "n_changed": edition_preview.n_changed,
        "n_moved": edition_preview.n_moved,
        "n_newly_rejected": edition_preview.n_newly_rejected,
        "progress": {
            **asdict(progress),
            "n_done": progress.n_done,
            "n_waiting": progress.n_waiting,
            "percent": progress.percent,
        },
        "changes": rows(edition_preview),
    }


@dataclass(frozen=True)
class _Side:
    edition: Edition
    evaluations: Mapping[UUID, Evaluation]
    scores: Mapping[UUID, Mapping[str, float | None]]
    ranks: Mapping[UUID, int | None]

    def values(self, submission: Submission) -> Mapping[str, float | None]:
        evaluation = self.evaluations.get(submission.pk)
        scores = self.scores.get(evaluation.pk) if evaluation else None
        return scores or dict.fromkeys(self.edition.rules.score_names)

    def status(self, submission: Submission) -> str:
        evaluation = self.evaluations.get(submission.pk)
        return evaluation.status if evaluation else ABSENT


def _side(edition: Edition) -> _Side:
    # A published board is kept for its readers; that of a draft is read now.
    read = snapshots.board if edition.published_at else listing.board
    board = read(split=edition.split, edition=edition, viewer=AnonymousUser())
    rows = Evaluation.objects.filter(edition=edition, submission__withdrawn_at=None)
    return _Side(
        edition=edition,
        evaluations={evaluation.submission_id: evaluation for evaluation in rows},
        scores={pk: scored.values for pk, scored in scored_in(edition).items()},
        ranks={entry.submission_id: entry.rank for entry in board.entries if entry.submission_id},
    )


def _change(submission: Submission, old: _Side, new: _Side) -> Change:
    evaluation = new.evaluations.get(submission.pk)
    return Change(
        submission_id=submission.pk,
        method=submission.method.name,
        team=submission.method.team.name,
        submitted_at=submission.submitted_at,
        is_seen_by_all=submission.method.was_shown(),
        old_status=old.status(submission),
        new_status=new.status(submission),
        old=old.values(submission),
        new=new.values(submission),
        old_rank=old.ranks.get(submission.pk),
        new_rank=new.ranks.get(submission.pk),
        problems=tuple(evaluation.problems) if evaluation else (),
        old_decimals=old.edition.decimals,
        new_decimals=new.edition.decimals,
    )


def _difference(old: float | None, new: float | None) -> float | None:
    # Both have two decimals at most; the subtraction of binary fractions must not show more.
    return None if old is None or new is None else round(new - old, 2)
