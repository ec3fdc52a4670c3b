"""Jobs of low priority, found in the database: count changed labels, compare, compute intervals, analyse."""

import random
from collections.abc import Callable, Iterable
from datetime import datetime
from functools import partial

import structlog
from django.db import InterfaceError, OperationalError

from leaderboard.editions import ground_truth
from leaderboard.queue import worker
from leaderboard.statistics import analyses, comparison_queue, comparisons, confidence, recording_sums
from leaderboard.storage import truth_values

log = structlog.get_logger(__name__)

# Of each kind at most so much in one go, so that every kind has its turn.
MAX_AT_ONCE = 50


class Stopping(Exception):
    """The worker is to end; another worker begins the task again."""


def work_off(*, now: datetime, rng: random.Random, is_stopping: Callable[[], bool] = lambda: False) -> int:
    """Do the waiting jobs that this worker has the values for. Returns how many.

    What fails is logged and left for the next time. A fault that nobody foresaw is raised once all other jobs
    have had their turn.
    """
    between = partial(_yield_to_live_work, rng=rng, is_stopping=is_stopping)
    n_done, bugs = 0, list[Exception]()
    try:
        for task in _tasks(now=now, between=between):
            try:
                n_done += _done(task, between)
            except (Stopping, OperationalError, InterfaceError):
                raise
            except Exception as bug:  # noqa: BLE001 - raised below
                bugs.append(bug)
    except Stopping:
        return 0
    if bugs:
        raise bugs[0]
    return n_done


def _done(task: Callable[[], object], between: Callable[[], None]) -> bool:
    between()
    try:
        task()
    except recording_sums.FAULTS as fault:
        log.warning("backlog_failed", reason=f"{type(fault).__name__}: {fault}"[:200])
        return False
    return True


def _tasks(*, now: datetime, between: Callable[[], None]) -> Iterable[Callable[[], object]]:
    readable_truths = truth_values.readable_digests()
    for old, new in ground_truth.uncompared(readable_truths=readable_truths):
        yield partial(ground_truth.count_changes, old, new)
    asked = comparison_queue.waiting(readable_truths=readable_truths).select_related(
        "edition__ground_truth", "edition__split", "first__submission__method", "second__submission__method"
    )
    begun: list[int] = []
    # Asked again each time: a user may wait for a pair by now, while others were only noted.
    while len(begun) < MAX_AT_ONCE and (row := asked.exclude(pk__in=begun).first()) is not None:
        begun.append(row.pk)
        yield partial(comparisons.compute, row, now=now)
    # Before entries are read: those of what waits are to be among them.
    between()
    for entries in confidence.stale(now=now, readable_truths=readable_truths):
        yield partial(confidence.infer, entries, now=now, between=between)
    for evaluation in analyses.missing(readable_truths=readable_truths)[:MAX_AT_ONCE]:
        yield partial(analyses.make, evaluation, now=now)


def _yield_to_live_work(*, rng: random.Random, is_stopping: Callable[[], bool]) -> None:
    """Decide waiting submissions first: users wait for them."""
    while not is_stopping() and worker.run_next(rng=rng):
        pass
    if is_stopping():
        raise Stopping
