"""Estimates of the wait in the queue, from the last runs; None where nothing shows it.

What is counted on is seen, never configured: how long runs took, and how many went on at the same time. A
free worker is taken to claim at once; without a broker that is seconds off. A worker that has died stops
being counted as soon as the runs without it are the recent ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from statistics import fmean

from django.db.models import Count, Q
from django.db.models.functions import Now

from leaderboard.db import clock
from leaderboard.models import Evaluation, Status
from leaderboard.ops import health

N_RUNS = 50
"""As many of the last runs are looked at."""
ALIVE_S = health.MAX_SWEEP_AGE_S
"""A sweep or a claim this recent shows that somebody works."""
LATE_TIMES = 3
"""What takes more than so many times what was to be expected takes longer than usual."""
LEAST_USUAL_S = 5.0
"""An expected wait is taken to be at least this long: nobody wonders about a second or two."""
UNKNOWN_RUN_S = 10.0
"""A run is taken to be this long where none was seen."""


@dataclass(frozen=True)
class RecentRun:
    """An evaluation that was decided: when it was last claimed, and finished."""

    started_at: datetime
    finished_at: datetime

    @property
    def took_s(self) -> float:
        """From claim to decision."""
        return (self.finished_at - self.started_at).total_seconds()

    def is_running_at(self, at: datetime) -> bool:
        """Whether a worker held it then."""
        return self.started_at <= at < self.finished_at


@dataclass(frozen=True)
class Evidence:
    """What the database shows of the workers. `n_running` counts the claims that are held now."""

    now: datetime
    runs: Sequence[RecentRun]
    n_running: int
    is_alive: bool


@dataclass(frozen=True)
class QueuePlace:
    """Where an evaluation stands: how many go first, and the seconds to its result, if anything tells.

    `is_late`: it has waited much longer than was to be expected when it was queued.
    """

    n_ahead: int
    estimate_s: float | None
    is_late: bool = False


def place_of(evaluation: Evaluation) -> QueuePlace | None:
    """Where an evaluation stands; None once it is decided."""
    if evaluation.is_final:
        return None
    if evaluation.priority != Evaluation.PRIORITY_LIVE:
        # Re-scoring goes in batches behind everything else: single runs say nothing about it.
        return QueuePlace(n_ahead=_n_ahead(evaluation), estimate_s=None)
    evidence = _evidence()
    late = _is_late(evaluation, evidence)
    if evaluation.status == Status.RUNNING and evaluation.started_at is not None:
        elapsed_s = (evidence.now - evaluation.started_at).total_seconds()
        return QueuePlace(0, left_s(evidence, elapsed_s=elapsed_s), is_late=late)
    n_ahead = _n_ahead(evaluation)
    due_in_s = (evaluation.due_at - evidence.now).total_seconds()
    return QueuePlace(n_ahead, wait_s(evidence, n_ahead=n_ahead, due_in_s=due_in_s), is_late=late)


# --- from evidence to seconds ---------------------------------------------------------------------------


def wait_s(evidence: Evidence, *, n_ahead: int, due_in_s: float = 0.0) -> float | None:
    """Seconds until the result of one that is queued behind `n_ahead` others and not due before `due_in_s`.

    With c workers and runs of r seconds, one run ends every r / c seconds; a worker is free for this one
    after as many ends as there are evaluations before it, less the workers that have nothing to do.
    """
    if not evidence.runs or not evidence.is_alive:
        return None
    run_s = fmean(run.took_s for run in evidence.runs)
    n_workers = seen_workers(evidence)
    n_ends = evidence.n_running + n_ahead - n_workers + 1
    return max(n_ends * run_s / n_workers, due_in_s, 0.0) + run_s


def usual_s(evidence: Evidence, *, n_before: int) -> float:
    """Seconds that were to be expected with `n_before` others queued or running, and workers as were seen."""
    seen = replace(evidence, n_running=0, is_alive=True)
    expected_s = wait_s(seen, n_ahead=n_before)
    return max(LEAST_USUAL_S, (n_before + 1) * UNKNOWN_RUN_S if expected_s is None else expected_s)


def left_s(evidence: Evidence, *, elapsed_s: float) -> float | None:
    """Seconds left of a run that has gone on for `elapsed_s`: what longer runs took beyond that, on average.

    None if none took longer: then nothing is known.
    """
    longer_s = [run.took_s - elapsed_s for run in evidence.runs if run.took_s > elapsed_s]
    return fmean(longer_s) if longer_s else None


def seen_workers(evidence: Evidence) -> int:
    """How many evaluations were seen to run at the same time, at least one."""
    at_once = [sum(run.is_running_at(each.started_at) for run in evidence.runs) for each in evidence.runs]
    return max(1, evidence.n_running, *at_once)


# --- from the database to evidence ----------------------------------------------------------------------


def _evidence() -> Evidence:
    decided = Evaluation.objects.filter(
        status__in=[Status.SCORED, Status.REJECTED],
        priority=Evaluation.PRIORITY_LIVE,
        started_at__isnull=False,
    )
    rows = decided.order_by("-finished_at").values_list("started_at", "finished_at")[:N_RUNS]
    runs = [RecentRun(started, finished) for started, finished in rows if started and finished]
    # A batch of re-scoring is held by one worker: its claims share their tokens.
    held = Evaluation.objects.filter(status=Status.RUNNING, leased_until__gt=Now())
    n_running: int = held.aggregate(n=Count("lease_token", distinct=True))["n"]
    now = clock.database_now()
    age_s = health.sweep_age_s()
    is_alive = (
        n_running > 0
        or (age_s is not None and age_s < ALIVE_S)
        or any(now - run.started_at < timedelta(seconds=ALIVE_S) for run in runs)
    )
    return Evidence(now=now, runs=runs, n_running=n_running, is_alive=is_alive)


def _is_late(evaluation: Evaluation, evidence: Evidence) -> bool:
    """Whether it waits longer than usual; asked of the database only once that can be."""
    waited_s = (evidence.now - evaluation.queued_at).total_seconds()
    if waited_s <= LATE_TIMES * LEAST_USUAL_S:
        return False
    at = evaluation.queued_at
    unfinished_then = Q(finished_at=None) | Q(finished_at__gt=at)
    before = Evaluation.objects.filter(unfinished_then, queued_at__lt=at, priority=Evaluation.PRIORITY_LIVE)
    return waited_s > LATE_TIMES * usual_s(evidence, n_before=before.count())


def _n_ahead(evaluation: Evaluation) -> int:
    """How many are claimed before this one; those that wait for another try are not in its way."""
    if evaluation.status != Status.QUEUED:
        return 0
    earlier = Q(priority__lt=evaluation.priority) | Q(
        priority=evaluation.priority, queued_at__lt=evaluation.queued_at
    )
    # What has stopped its reader waits behind all others.
    waiting = Evaluation.objects.filter(
        earlier,
        status=Status.QUEUED,
        due_at__lte=Now(),
        n_poison_strikes__lte=evaluation.n_poison_strikes,
    )
    return waiting.exclude(pk=evaluation.pk).count()
