"""Evaluations made straight in the database, and ways to move their clocks, for tests of the queue."""

import random
import uuid
from dataclasses import replace
from datetime import timedelta

from django.db import transaction
from django.db.models import F
from django.db.models.functions import Now
from django.utils import timezone

from leaderboard.models import Edition, Evaluation, Method, Score, Status, Submission, User
from leaderboard.people import teams
from leaderboard.queue import lifecycle
from leaderboard.queue.lifecycle import Lease, RunResult, Strike

LEASE_S = 60.0
WALL_S = 300.0
SCORED = RunResult(
    status=Status.SCORED,
    scores={("mid", "overall"): 14.25, ("rte", "overall"): 9.5},
    report={"counts": {"overall": 3}},
    report_digest="sha256:0",
)
REJECTED = RunResult(
    status=Status.REJECTED,
    scores={},
    problems=[{"code": "not-json", "message": "The text is not JSON.", "where": ""}],
    n_problems=1,
)


def queued(edition: Edition, user: User, *, priority: int = Evaluation.PRIORITY_LIVE) -> Evaluation:
    """An evaluation in the queue, of a submission whose file nobody will read."""
    method, _ = Method.objects.get_or_create(team=teams.team_of(user=user), name="Foo")
    submission = Submission.objects.create(
        split=edition.split,
        method=method,
        submitted_by=user,
        submitted_at=timezone.now(),
        via=Submission.Via.API,
        digest=f"sha256:{uuid.uuid4().hex}",
        manifest_digest=edition.ground_truth.manifest_digest,
        size_bytes=2,
    )
    return lifecycle.enqueue(submission=submission, edition=edition, priority=priority)


def claim() -> Lease:
    """The next lease; there must be one."""
    [lease] = lifecycle.claim(lease_s=LEASE_S, wall_s=WALL_S)
    return lease


def make_due() -> None:
    """End every backoff, once nobody holds a row of the queue any more.

    The rows are locked in one order, as the product's verbs do: two of these at once would wait for each
    other for ever, if each took the rows as it met them.
    """
    with transaction.atomic():
        rows = Evaluation.objects.filter(status=Status.QUEUED).order_by("pk").select_for_update(no_key=True)
        waiting = list(rows.values_list("pk", flat=True))
        Evaluation.objects.filter(pk__in=waiting).update(due_at=Now())


def expire(lease: Lease, *, overran: bool = False) -> None:
    """Let the lease have run out a second ago: because its worker vanished, or at the deadline of the run."""
    past = Now() - timedelta(seconds=1)
    Evaluation.objects.filter(pk=lease.evaluation_id).update(
        leased_until=past, deadline_at=past if overran else F("deadline_at")
    )


def release_expired() -> int:
    """One sweep."""
    return lifecycle.release_expired(rng=random.Random(0))


def n_scores(lease: Lease) -> int:
    """Scores written for the evaluation of this lease."""
    return Score.objects.filter(evaluation=lease.evaluation_id).count()


def row(lease: Lease) -> Evaluation:
    """The evaluation of this lease as the database has it."""
    return Evaluation.objects.get(pk=lease.evaluation_id)


def give_back(
    lease: Lease, strike: Strike = Strike.INFRASTRUCTURE, *, reason: str = "the disk failed"
) -> Status:
    """End a run without a result; the state it left."""
    return lifecycle.fail_attempt(lease, strike=strike, reason=reason, rng=random.Random(0))


def strike_out(*, reason: str = "signal 9") -> None:
    """Let what is the next in line stop its reader until it is a system error."""
    for _ in range(lifecycle.MAX_POISON_STRIKES):
        make_due()
        give_back(claim(), Strike.POISON, reason=reason)


def stale(lease: Lease) -> dict[str, Lease]:
    """The lease of an earlier attempt, of another worker, and of another evaluation."""
    return {
        "attempt": replace(lease, attempt=lease.attempt - 1),
        "token": replace(lease, token=uuid.uuid4()),
        "evaluation": replace(lease, evaluation_id=uuid.uuid4()),
    }
