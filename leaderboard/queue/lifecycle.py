"""The life of an evaluation; no other module writes a status.

    QUEUED -> RUNNING -> SCORED           scores, report and status in one transaction
                      -> REJECTED         the file is at fault
                      -> QUEUED           a strike: the lease ran out, or the parsing child died;
                                          or handed back before it was begun
                      -> SYSTEM_ERROR     strikes exhausted, or another try is of no use: our fault
    QUEUED | RUNNING  -> CANCELLED        by its team
    SYSTEM_ERROR      -> QUEUED           retried by a maintainer

A worker claims with attempt number, lease token and deadline, renews the lease, and finishes by
compare-and-set on all three, so a late worker changes nothing. All times are the database's.
"""

import logging
import random
import uuid
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import structlog
from django.conf import settings
from django.db import transaction
from django.db.models import F, Q, QuerySet
from django.db.models.functions import Least, Now

from leaderboard import audit, board_versions
from leaderboard.db.clock import after, database_now
from leaderboard.models import Edition, Evaluation, Score, Status, Submission, User
from leaderboard.models.submissions import MAX_INFRASTRUCTURE_STRIKES, MAX_POISON_STRIKES
from leaderboard.ops import broker, faults

log = structlog.get_logger(__name__)

MAX_BACKOFF_S = 60.0
# Large enough that round trips and COMMITs are nothing beside the arithmetic; small enough that a live
# submission waits for a fraction of a second. Of the last a worker takes half, so that two end together.
RESCORE_BATCH, SMALL_BATCH = 100, 25


def batch_of(n_waiting: int) -> int:
    """Return how many of an edition's waiting evaluations a worker takes at once."""
    return min(RESCORE_BATCH, max(SMALL_BATCH, -(-n_waiting // 2)))


class LostRace(Exception):
    """Another worker decided this evaluation meanwhile."""


class Strike(Enum):
    """Why a run failed."""

    POISON = "POISON"  # the process died or overran on this very file
    INFRASTRUCTURE = "INFRASTRUCTURE"  # the worker, the database or the disk failed; the file may be innocent


@dataclass(frozen=True)
class Lease:
    """The right to decide one evaluation, while the row names this attempt and token."""

    evaluation_id: uuid.UUID
    attempt: int
    token: uuid.UUID


@dataclass(frozen=True)
class RunResult:
    """The outcome of a run.

    `scores` maps (metric, TTC range) to a published value; `problems` is shown to the submitter.
    """

    status: Status
    scores: Mapping[tuple[str, str], float]
    report: Mapping[str, Any] | None = None
    report_digest: str = ""
    problems: Sequence[Mapping[str, str]] = ()
    n_problems: int = 0


# --- into the queue --------------------------------------------------------------------------------------


def enqueue(
    *, submission: Submission, edition: Edition, priority: int = Evaluation.PRIORITY_LIVE
) -> Evaluation:
    """Queue a submission for an edition, once. Returns the evaluation, which may exist already.

    Must run inside the transaction that makes the submission; the nudge follows its commit.
    """
    evaluation, is_new = Evaluation.objects.get_or_create(
        submission=submission,
        edition=edition,
        defaults={"priority": priority, "queued_at": Now(), "due_at": Now()},
    )
    if is_new:
        # Robust: the rows are committed by then, and nothing may turn that into a failure.
        transaction.on_commit(lambda: _announce(evaluation), robust=True)
    return evaluation


def _announce(evaluation: Evaluation) -> None:
    with structlog.contextvars.bound_contextvars(
        submission_id=str(evaluation.submission_id), evaluation_id=str(evaluation.pk)
    ):
        log.info("evaluation_queued")
        broker.nudge()


def enqueue_many(*, submission_ids: Sequence[uuid.UUID], edition: Edition) -> None:
    """Queue many submissions for an edition's re-scoring, each once.

    Must run inside the transaction that has locked the split; the nudges follow its commit.
    """
    Evaluation.objects.bulk_create(
        [
            Evaluation(
                submission_id=pk,
                edition=edition,
                priority=Evaluation.PRIORITY_RESCORE,
                queued_at=Now(),
                due_at=Now(),
            )
            for pk in submission_ids
        ],
        ignore_conflicts=True,
    )
    n_waiting = len(submission_ids)
    while n_waiting > 0:
        transaction.on_commit(broker.nudge, robust=True)
        n_waiting -= batch_of(n_waiting)


# --- workers ---------------------------------------------------------------------------------------------


def claim(
    *,
    lease_s: float,
    wall_s: float,
    limit: int = 1,
    in_batches: bool = False,
    readable_truths: Collection[str] | None = None,
) -> list[Lease]:
    """Take up to `limit` evaluations that are queued and due, the most urgent and oldest first.

    `readable_truths` are the digests that this worker can score. With `in_batches`, some more of the edition
    if the first is a re-scoring. Two workers never get the same one.
    """
    token = uuid.uuid4()
    with transaction.atomic():
        due = Evaluation.objects.due()
        if readable_truths is not None:
            due = due.scorable(readable_truths)
        # What others have locked is left out. SQLite has one writer, and skips nothing.
        free = due.select_for_update(skip_locked=True, no_key=True)
        waiting = free.values_list("pk", "attempt", "priority", "edition")
        rows = list(waiting[:limit])
        if not rows:
            return []
        alike = {"priority": rows[0][2], "edition": rows[0][3]}
        if alike["priority"] == Evaluation.PRIORITY_RESCORE and in_batches:
            n_waiting = Evaluation.objects.due().filter(**alike)[: 2 * RESCORE_BATCH].count()
            more = waiting.filter(**alike).exclude(pk__in=[row[0] for row in rows])
            rows += more[: max(batch_of(n_waiting) - len(rows), 0)]
        Evaluation.objects.filter(pk__in=[row[0] for row in rows], status=Status.QUEUED).update(
            status=Status.RUNNING,
            attempt=F("attempt") + 1,
            lease_token=token,
            started_at=Now(),
            deadline_at=after(wall_s),
            leased_until=after(min(lease_s, wall_s)),
        )
    return [Lease(evaluation_id=pk, attempt=attempt + 1, token=token) for pk, attempt, _, _ in rows]


def _leased_row(lease: Lease) -> QuerySet[Evaluation]:
    return Evaluation.objects.filter(
        pk=lease.evaluation_id, status=Status.RUNNING, attempt=lease.attempt, lease_token=lease.token
    )


def heartbeat(lease: Lease, *, lease_s: float) -> bool:
    """Renew the lease, never beyond the deadline. False: stop work, another worker has it."""
    renewed = (
        _leased_row(lease)
        .filter(deadline_at__gt=Now())
        .update(leased_until=Least(after(lease_s), F("deadline_at")))
    )
    return renewed == 1


def finalise(lease: Lease, outcome: RunResult) -> bool:
    """Write status, scores, report and audit row, all or nothing.

    Returns False if an earlier call of the same lease wrote it (the answer to its COMMIT was lost).
    Raises `LostRace` if the lease is no longer valid.
    """
    if finalise_many([(lease, outcome)]):
        return True
    if Evaluation.objects.filter(
        pk=lease.evaluation_id, finished_attempt=lease.attempt, lease_token=lease.token, status=outcome.status
    ).exists():
        return False
    raise LostRace(f"evaluation {lease.evaluation_id}: attempt {lease.attempt} is no longer the valid one")


def finalise_many(outcomes: Sequence[tuple[Lease, RunResult]]) -> set[uuid.UUID]:
    """Write many outcomes in one transaction. Returns the evaluations that were written.

    Others had a lease that is no longer valid.
    """
    for _, outcome in outcomes:
        if outcome.status not in (Status.SCORED, Status.REJECTED):
            raise ValueError(f"a run ends as SCORED or REJECTED, not as {outcome.status}")
    with transaction.atomic():
        valid_ids = _locked([lease for lease, _ in outcomes])
        decided = [(lease, outcome) for lease, outcome in outcomes if lease.evaluation_id in valid_ids]
        for lease, outcome in decided:
            Evaluation.objects.filter(pk=lease.evaluation_id).update(
                status=outcome.status,
                finished_at=Now(),
                finished_attempt=lease.attempt,
                last_error="",
                report=outcome.report,
                report_digest=outcome.report_digest,
                problems=list(outcome.problems),
                n_problems=outcome.n_problems,
            )
        Score.objects.bulk_create(
            Score(evaluation_id=lease.evaluation_id, metric=metric, ttc_range=ttc_range, value=value)
            for lease, outcome in decided
            for (metric, ttc_range), value in outcome.scores.items()
        )
        audit.record_many(
            (
                *(outcome.status.lower(), "Evaluation", lease.evaluation_id),
                {"attempt": lease.attempt, "report_digest": outcome.report_digest},
            )
            for lease, outcome in decided
        )
        board_versions.bump_for_evaluations(lease.evaluation_id for lease, _ in decided)
    return {lease.evaluation_id for lease, _ in decided}


def _locked(leases: Sequence[Lease]) -> set[uuid.UUID]:
    valid = {(lease.evaluation_id, lease.attempt, lease.token) for lease in leases}
    ids = [lease.evaluation_id for lease in leases]
    rows = Evaluation.objects.select_for_update(no_key=True).filter(pk__in=ids, status=Status.RUNNING)
    # Every batch locks in the same order, so that two cannot wait for each other.
    running = rows.order_by("pk").values_list("pk", "attempt", "lease_token")
    return {row[0] for row in running if row in valid}


def fail_attempt(
    lease: Lease, *, strike: Strike, reason: str, rng: random.Random, is_last: bool = False
) -> Status:
    """End a failed run with a strike. Returns the new state, QUEUED or SYSTEM_ERROR.

    `is_last` gives up at once. Raises `LostRace` if the lease is no longer valid.
    """
    with transaction.atomic():
        evaluation = _leased_row(lease).select_for_update(no_key=True).first()
        if evaluation is None:
            raise LostRace(f"evaluation {lease.evaluation_id}: attempt {lease.attempt} is no longer valid")
        return _strike(evaluation, strike=strike, reason=reason, rng=rng, is_last=is_last)


def release(leases: Sequence[Lease]) -> int:
    """Queue again what was claimed and never begun, without a strike. Returns how many."""
    with transaction.atomic():
        valid_ids = _locked(leases)
        running = Evaluation.objects.filter(pk__in=valid_ids, status=Status.RUNNING)
        return running.update(status=Status.QUEUED, leased_until=None)


# --- the sweep -------------------------------------------------------------------------------------------


def release_expired(*, rng: random.Random) -> int:
    """Take back the evaluations of dead workers. Returns how many.

    A worker that renewed up to the deadline overran on this file: poison. One whose lease ran out earlier
    vanished: infrastructure. The time now proves nothing, since a sweep may come late.
    """
    rows = Evaluation.objects.filter(status=Status.RUNNING, leased_until__lt=Now())
    # Asked first: every worker looks every few seconds, and there is hardly ever one.
    if not rows.exists():
        return 0
    with transaction.atomic():
        expired = list(
            rows.select_for_update(skip_locked=True, no_key=True).annotate(
                overran=Q(leased_until__gte=F("deadline_at"))
            )
        )
        # All sweeps lock the counters of the two kinds of strikes in one order.
        for evaluation in sorted(expired, key=lambda row: row.overran):
            overran: bool = evaluation.overran
            _strike(
                evaluation,
                strike=Strike.POISON if overran else Strike.INFRASTRUCTURE,
                reason="the run reached its time limit" if overran else "the worker stopped answering",
                rng=rng,
            )
    return len(expired)


def _strike(
    evaluation: Evaluation, *, strike: Strike, reason: str, rng: random.Random, is_last: bool = False
) -> Status:
    """Count a strike against a locked RUNNING row; queue it again, or give up."""
    n_poison = evaluation.n_poison_strikes + (strike is Strike.POISON)
    n_infrastructure = evaluation.n_infrastructure_strikes + (strike is Strike.INFRASTRUCTURE)
    exhausted = n_poison >= MAX_POISON_STRIKES or n_infrastructure >= MAX_INFRASTRUCTURE_STRIKES
    exhausted = exhausted or is_last
    changes: dict[str, Any] = {
        "n_poison_strikes": n_poison,
        "n_infrastructure_strikes": n_infrastructure,
        "last_error": reason[:500],
    }
    if exhausted:
        status = Status.SYSTEM_ERROR
        changes |= {"finished_at": Now(), "finished_attempt": F("attempt")}
    else:
        status = Status.QUEUED
        backoff_s = min(settings.BACKOFF_S * 2 ** (n_poison + n_infrastructure - 1), MAX_BACKOFF_S)
        changes |= {"due_at": after(backoff_s * rng.uniform(0.5, 1.0)), "leased_until": None}
    Evaluation.objects.filter(pk=evaluation.pk, status=Status.RUNNING, attempt=evaluation.attempt).update(
        status=status, **changes
    )
    log.log(
        logging.ERROR if exhausted else logging.WARNING,
        "evaluation_struck",
        submission_id=str(evaluation.submission_id),
        evaluation_id=str(evaluation.pk),
        attempt=evaluation.attempt,
        strike=strike.value,
        reason=reason,
        status=status.value,
    )
    if exhausted:
        audit.record_of(evaluation, "system_error", details={"reason": reason})
    # A counter of its own, the last that is locked: a retry wipes the strikes of its evaluation.
    faults.note(faults.STRIKES, subject=strike.value.lower(), reason=reason, now=database_now())
    return status


# --- people ----------------------------------------------------------------------------------------------


def cancel_edition(*, edition: Edition) -> int:
    """Cancel what is undecided in an edition that was given up. Returns how many."""
    return _cancel(Evaluation.objects.filter(edition=edition))


def cancel(*, submission: Submission, actor: User | None) -> int:
    """Cancel the undecided evaluations of a submission. Returns how many."""
    with transaction.atomic():
        n_cancelled = _cancel(Evaluation.objects.filter(submission=submission))
        if n_cancelled:
            audit.record_of(submission, "cancelled", actor=actor)
    return n_cancelled


def _cancel(evaluations: QuerySet[Evaluation]) -> int:
    undecided = evaluations.filter(status__in=[Status.QUEUED, Status.RUNNING])
    # In the order in which a batch is locked, so that neither has what the other waits for.
    rows = undecided.order_by("pk").select_for_update(no_key=True).values_list("pk", flat=True)
    return undecided.filter(pk__in=list(rows)).update(status=Status.CANCELLED, finished_at=Now())


def retry(*, evaluation: Evaluation, actor: User, reason: str = "") -> None:
    """Queue a system error again with a clean slate. Raises `LostRace` if it is no system error any more."""
    with transaction.atomic():
        changed = Evaluation.objects.filter(pk=evaluation.pk, status=Status.SYSTEM_ERROR).update(
            status=Status.QUEUED,
            due_at=Now(),
            finished_at=None,
            finished_attempt=None,
            n_poison_strikes=0,
            n_infrastructure_strikes=0,
        )
        if not changed:
            raise LostRace(f"evaluation {evaluation.pk} is not a system error; there is nothing to retry")
        audit.record_of(evaluation, "retried", actor=actor, details={"reason": reason})
        transaction.on_commit(lambda: _announce(evaluation), robust=True)
