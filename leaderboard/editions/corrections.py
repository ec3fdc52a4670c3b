"""Corrections: re-score every active submission in a new edition, compare, publish, roll back.

Publishing moves one pointer; nothing that was published is ever changed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Final

from django.db import transaction
from django.db.models import Count, Min, Q

from evaluator.counting import counted
from evaluator.metrics.protocol import get_protocol
from leaderboard import audit
from leaderboard.db import clock
from leaderboard.editions import ground_truth
from leaderboard.errors.refusals import Refused, clean_text, require_maintainer
from leaderboard.models import Edition, Evaluation, GroundTruth, Publication, Split, Status, Submission, User
from leaderboard.queue import lifecycle

MAX_REASON: Final = 1000


@dataclass(frozen=True)
class RescoringProgress:
    n_total: int
    n_scored: int
    n_rejected: int
    n_failed: int  # system errors
    n_cancelled: int
    rate_per_s: float | None
    left_s: float | None

    @property
    def n_done(self) -> int:
        return self.n_scored + self.n_rejected + self.n_failed + self.n_cancelled

    @property
    def n_waiting(self) -> int:
        return self.n_total - self.n_done

    @property
    def percent(self) -> int:
        # Rounded down, so that 100 means done.
        return 100 if self.n_total == 0 else 100 * self.n_done // self.n_total


def open_edition(
    *,
    split_name: str,
    now: datetime,
    actor: User | None,
    path: Path | None = None,
    digest: str | None = None,
    protocol: str | None = None,
) -> Edition:
    """Open an edition next to the published one and queue every active submission for it.

    The ground truth is read from `path`, or is the imported one of that `digest`; it and the protocol stay
    unless given. A former edition is opened again: it then gets new submissions too, until it is published or
    discarded. A second call with the same input queues nothing twice. `actor` None is the command line.
    Raises `NotMaintainer`, `Refused`, or `evaluator.Rejected`.
    """
    require_maintainer(actor, to="change editions")
    split = Split.objects.select_related("current_edition__ground_truth").filter(name=split_name).first()
    if split is None or split.current_edition is None:
        raise Refused(
            "edition-refused",
            f"The split {split_name!r} has no published edition to correct; "
            f"open it with: manage.py import_truth {split_name} PATH",
        )
    protocol = protocol or split.current_edition.protocol
    get_protocol(protocol)
    if path is not None:
        row = ground_truth.add(split_name=split_name, path=path, now=now, actor=actor)
    else:
        row = _imported(split, digest)
        ground_truth.require_unmarked(split, row)
    unit = ground_truth.units_of(row).kind
    with transaction.atomic():
        split = Split.objects.select_for_update(no_key=True).get(pk=split.pk)
        edition = split.editions.filter(
            ground_truth=row, protocol=protocol, decimals=split.decimals, unit=unit, discarded_at=None
        ).first()
        if edition is None:
            edition = ground_truth.new_edition(split=split, row=row, protocol=protocol, now=now, actor=actor)
        elif edition.pk == split.current_edition_id:
            raise Refused(
                "edition-refused",
                f"{edition} has this ground truth, protocol and number of decimals ({split.decimals}), "
                "and is the current board already.",
            )
        elif edition.published_at and edition.reopened_at is None:
            edition.reopened_at = now
            edition.save(update_fields=["reopened_at"])
            audit.record_of(edition, "reopened", actor=actor, details={"edition": str(edition)})
        ground_truth.queue_missing(edition)
    return edition


def _imported(split: Split, digest: str | None) -> GroundTruth:
    if digest is None:
        assert split.current_edition is not None  # noqa: S101 - the caller has looked
        return split.current_edition.ground_truth
    row = GroundTruth.objects.filter(split=split.truth_split_id, digest=digest).first()
    if row is None:
        raise Refused(
            "edition-refused",
            f"The split {split.pk!r} has no ground truth {digest[:80]!r}; import it with --truth first.",
        )
    return row


def progress(edition: Edition) -> RescoringProgress:
    """Count the decided evaluations; of a draft that is re-scored, with a rate since the first start."""
    rows = Evaluation.objects.filter(edition=edition, submission__withdrawn_at=None)

    def of(*statuses: Status) -> Count:
        return Count("pk", filter=Q(status__in=statuses))

    counts = rows.aggregate(
        n_total=Count("pk"),
        n_scored=of(Status.SCORED),
        n_rejected=of(Status.REJECTED),
        n_failed=of(Status.SYSTEM_ERROR),
        n_cancelled=of(Status.CANCELLED),
        first=Min("started_at"),
    )
    first = counts.pop("first")
    so_far = RescoringProgress(**counts, rate_per_s=None, left_s=None)
    # The files of a board, also of a former one, come over weeks: their rate says nothing.
    if not edition.is_draft or first is None or not so_far.n_done or not so_far.n_waiting:
        return so_far
    rate_per_s = so_far.n_done / max((clock.database_now() - first).total_seconds(), 0.001)
    return replace(so_far, rate_per_s=rate_per_s, left_s=so_far.n_waiting / rate_per_s)


def unfinished(edition: Edition) -> list[Submission]:
    """Return active submissions of the split that this edition has neither scored nor rejected."""
    done = Evaluation.objects.filter(edition=edition, status__in=[Status.SCORED, Status.REJECTED])
    return list(ground_truth.active_submissions(edition).exclude(pk__in=done.values("submission")))


def newly_rejected(edition: Edition) -> list[Submission]:
    """Return active submissions that the board scores and this edition rejects."""
    here = Evaluation.objects.filter(edition=edition, status=Status.REJECTED)
    board = Evaluation.objects.filter(edition=edition.split.current_edition_id, status=Status.SCORED)
    return list(
        ground_truth.active_submissions(edition)
        .filter(pk__in=here.values("submission"))
        .filter(pk__in=board.values("submission"))
    )


def publish(
    *,
    edition: Edition,
    reason: str,
    now: datetime,
    actor: User | None,
    replaces: int | None,
    leave_out: bool = False,
) -> Publication:
    """Make an edition the board of its split, and queue what it lacks, in one transaction.

    `replaces` is the number of the edition that the maintainer compared with. `leave_out` accepts that
    unfinished or newly rejected submissions leave the board. Raises `NotMaintainer` or `Refused`.
    """
    require_maintainer(actor, to="change editions")
    reason = _reason(reason)
    with transaction.atomic():
        edition, split = _locked(edition)
        if edition.discarded_at or edition.pk == split.current_edition_id:
            state = "was discarded" if edition.discarded_at else "is the current board already"
            raise Refused("edition-refused", f"{edition} {state}; there is nothing to publish.")
        _require_same_board(split, replaces)
        waiting, losing = unfinished(edition), newly_rejected(edition)
        if (waiting or losing) and not leave_out:
            raise Refused("edition-refused", _left_out_sentence(edition, waiting, losing))
        return ground_truth.make_board(
            edition=edition,
            kind=Publication.Kind.PUBLISHED,
            reason=reason,
            now=now,
            actor=actor,
            left_out=[str(submission.pk) for submission in (*waiting, *losing)],
        )


def roll_back(
    *, split_name: str, reason: str, now: datetime, actor: User | None, replaces: int | None
) -> Publication:
    """Make the earlier edition the board again, and queue for it what was submitted since.

    Raises `NotMaintainer` or `Refused`.
    """
    require_maintainer(actor, to="change editions")
    reason = _reason(reason)
    with transaction.atomic():
        split = Split.objects.select_for_update(no_key=True).get(pk=split_name)
        _require_same_board(split, replaces)
        former = predecessor(split)
        if former is None:
            raise Refused(
                "edition-refused",
                f"{split.current_edition or split.pk} replaced no edition; it cannot be rolled back.",
            )
        return ground_truth.make_board(
            edition=former,
            kind=Publication.Kind.ROLLED_BACK,
            reason=reason,
            now=now,
            actor=actor,
        )


def predecessor(split: Split) -> Edition | None:
    """Return the edition that rolling back returns to."""
    latest = split.publications.filter(
        edition=split.current_edition_id, kind=Publication.Kind.PUBLISHED
    ).first()
    if latest is None or latest.replaced_id is None:
        return None
    return Edition.objects.select_related("split__current_edition", "ground_truth").get(pk=latest.replaced_id)


def discard(*, edition: Edition, reason: str, now: datetime, actor: User | None) -> None:
    """Give up an edition in preparation. Raises `NotMaintainer` or `Refused`.

    What waits for a draft is cancelled. A former edition that was opened again stays one: no further
    submissions are queued for it, and what waits is scored, because it may be opened or published again.
    """
    require_maintainer(actor, to="change editions")
    reason = _reason(reason)
    with transaction.atomic():
        edition, _ = _locked(edition)
        if not edition.is_in_preparation:
            raise Refused("edition-refused", f"{edition} is not in preparation; there is nothing to discard.")
        if edition.is_draft:
            edition.discarded_at = now
            lifecycle.cancel_edition(edition=edition)
        edition.reopened_at = None
        edition.save(update_fields=["discarded_at", "reopened_at"])
        verb = "discarded" if edition.discarded_at else "closed_again"
        audit.record_of(edition, verb, actor=actor, details={"reason": reason})


def _locked(edition: Edition) -> tuple[Edition, Split]:
    split = Split.objects.select_for_update(no_key=True).get(pk=edition.split_id)
    edition = Edition.objects.get(pk=edition.pk)
    edition.split = split
    return edition, split


def _require_same_board(split: Split, replaces: int | None) -> None:
    published = split.current_edition.number if split.current_edition else None
    if published != replaces:
        raise Refused(
            "edition-refused",
            f"The current edition of {split.pk!r} is {published}, no longer {replaces}; look again.",
        )


def _reason(text: str) -> str:
    text = " ".join(text.split())
    if not text:
        raise Refused("edition-refused", "No reason was given; expected a sentence for the public changelog.")
    return clean_text("reason", text[:MAX_REASON], limit=MAX_REASON)


def _left_out_sentence(edition: Edition, waiting: Sequence[Submission], losing: Sequence[Submission]) -> str:
    sentences = []
    if waiting:
        sentences.append(
            f"{edition} is not finished: {counted(len(waiting), 'submission is', 'submissions are')} neither "
            f"scored nor rejected: {_named(waiting)}. Wait, retry them, or confirm that they are left out."
        )
    if losing:
        sentences.append(
            f"{edition} rejects {counted(len(losing), 'entry', 'entries')} that the board scores: "
            f"{_named(losing)}. Confirm that they are left out, or correct the ground truth."
        )
    return " ".join(sentences)


def _named(rows: Sequence[Submission]) -> str:
    shown = ", ".join(f"{submission.method.name} ({submission.pk})" for submission in rows[:20])
    return f"{shown}, and {len(rows) - 20} more" if len(rows) > 20 else shown
