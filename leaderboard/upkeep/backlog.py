"""Jobs of low priority, found in the database: count changed labels, compare, compute intervals, analyse."""

import random
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from functools import partial

import structlog
from django.db import InterfaceError, OperationalError

from leaderboard.editions import ground_truth
from leaderboard.ops import faults
from leaderboard.queue import worker
from leaderboard.statistics import analyses, comparison_queue, comparisons, confidence
from leaderboard.storage import truth_values

log = structlog.get_logger(__name__)

# Of each kind at most so much in one go, so that every kind has its turn.
MAX_AT_ONCE = 50


class Stopping(Exception):
    """The worker is to end; another worker begins the task again."""


@dataclass(frozen=True)
class Job:
    """A job of a kind of `faults.STATISTICS`. `do` may return False: the job stays to be done."""

    kind: str
    subject: str
    do: Callable[[], object]


def work_off(*, now: datetime, rng: random.Random, is_stopping: Callable[[], bool] = lambda: False) -> int:
    """Do the waiting jobs that this worker has the values for. Returns how many.

    What fails is left for the next time, and noted in `faults`. Raises the database's error.
    """
    between = partial(_yield_to_live_work, rng=rng, is_stopping=is_stopping)
    n_done = 0
    done: set[tuple[str, str]] = set()
    failed: dict[tuple[str, str], Exception] = {}
    try:
        for job in _jobs(now=now, between=between):
            between()
            try:
                # False: another worker does it, or has to do it again.
                if job.do() is not False:
                    done.add((job.kind, job.subject))
                n_done += 1
            except (Stopping, OperationalError, InterfaceError):
                raise
            except Exception as fault:  # noqa: BLE001 - whatever it is, the other jobs do not wait for it
                failed[job.kind, job.subject] = fault
    except Stopping:
        pass
    _note(failed, now=now)
    for kind, subject in done - failed.keys():
        faults.clear(kind, subject=subject)
    return n_done


def _note(failed: Mapping[tuple[str, str], Exception], *, now: datetime) -> None:
    for (kind, subject), fault in failed.items():
        reason = f"{type(fault).__name__}: {fault}"
        # Logged once: from then on it is a state, which /healthy, the metrics and the maintainers' page show.
        if faults.note(kind, subject=subject, reason=reason, now=now):
            log.error("backlog_failed", kind=kind, subject=subject, reason=reason[:500], exc_info=fault)


def _jobs(*, now: datetime, between: Callable[[], None]) -> Iterator[Job]:
    readable_truths = truth_values.readable_digests()
    for old, new in ground_truth.uncompared(readable_truths=readable_truths):
        subject = f"{old.short_digest} and {new.short_digest}"
        yield Job(faults.LABEL_CHANGES, subject, partial(ground_truth.count_changes, old, new))
    asked = comparison_queue.waiting(readable_truths=readable_truths).select_related(
        "edition__ground_truth", "edition__split", "first__submission__method", "second__submission__method"
    )
    begun: list[int] = []
    # Asked again each time: a user may wait for a pair by now, while others were only noted.
    while len(begun) < MAX_AT_ONCE and (row := asked.exclude(pk__in=begun).first()) is not None:
        begun.append(row.pk)
        yield Job(faults.COMPARISONS, str(row.edition), partial(comparisons.compute, row, now=now))
    # Before entries are read: those of what waits are to be among them.
    between()
    for entries in confidence.stale(now=now, readable_truths=readable_truths):
        infer = partial(confidence.infer, entries, now=now, between=between)
        yield Job(faults.INTERVALS, str(entries.edition), infer)
    for evaluation in analyses.missing(readable_truths=readable_truths)[:MAX_AT_ONCE]:
        make = partial(analyses.make, evaluation, now=now)
        yield Job(faults.ANALYSES, str(evaluation.edition), make)


def _yield_to_live_work(*, rng: random.Random, is_stopping: Callable[[], bool]) -> None:
    """Decide waiting submissions first: users wait for them."""
    while not is_stopping() and worker.run_next(rng=rng):
        pass
    if is_stopping():
        raise Stopping
