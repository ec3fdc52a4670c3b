"""The queue seen from outside: the sweep, and every worker looking for work by itself.

The broker makes things fast; these make them certain. A lost message, a flushed or absent broker, or a killed
beat delays scoring by seconds.
"""

import random
import threading
import time

import structlog
from django.conf import settings
from django.db import Error, connections

from leaderboard import (
    backlog,
    boards,
    broker,
    clock,
    ground_truth,
    health,
    lifecycle,
    rates,
    scoring,
    snapshots,
    visibility,
)
from leaderboard.models import Evaluation

log = structlog.get_logger(__name__)

MAX_NUDGES_PER_SWEEP = 100


def sweep(*, rng: random.Random) -> int:
    """Take back what dead workers hold and nudge again what waits. Returns how many nudges were sent.

    A worker that cannot read the ground truth of what waits leaves it to others, and says so.
    """
    lifecycle.release_expired(rng=rng)
    visibility.reveal_due(now=clock.database_now())
    boards.times_passed(now=clock.database_now())
    snapshots.check(now=clock.database_now())
    n_sent = 0
    for evaluation_id in lifecycle.waiting_ids(limit=MAX_NUDGES_PER_SWEEP):
        if not broker.nudge(evaluation_id):
            # A broker that does not answer takes seconds to say so, each time.
            break
        n_sent += 1
    for edition_id in backlog.editions_waiting(now=clock.database_now()):
        if not broker.infer(edition_id):
            break
    rates.forget_the_past(now_s=time.time())
    due = Evaluation.objects.due()
    n_out_of_reach = due.count() - due.scorable(ground_truth.held()).count()
    if n_out_of_reach:
        log.error("ground_truth_out_of_reach", n_waiting=n_out_of_reach)
    health.record_sweep(n_out_of_reach=n_out_of_reach)
    return n_sent


def look_for_work(*, rng: random.Random, stopping: threading.Event) -> int:
    """Take back what dead workers hold, then decide what waits until nothing does, or until `stopping`.

    Then what waits behind submissions. Returns how often one was decided. A database that is away is no fault
    of this look; the next one finds it.
    """
    n_found = 0
    try:
        lifecycle.release_expired(rng=rng)
        while not stopping.is_set() and scoring.run_next(rng=rng):
            n_found += 1
        work_behind(rng=rng, stopping=stopping)
    except (Error, OSError) as fault:
        log.warning("look_failed", reason=str(fault)[:200])
    finally:
        # They belong to the thread that looked, which ends here.
        connections.close_all()
    return n_found


def work_behind(*, rng: random.Random, stopping: threading.Event) -> int:
    """Do what waits behind submissions, until `stopping`. Returns how much was done."""
    if stopping.is_set():
        return 0
    return backlog.work_off(now=clock.database_now(), rng=rng, is_stopping=stopping.is_set)


class Poller(threading.Thread):
    """Looks for queued work every few seconds, whether or not a message came.

    Each look is a thread of its own with connections of its own: whatever goes wrong in one, the next starts
    afresh.
    """

    def __init__(self, *, rng: random.Random) -> None:
        super().__init__(name="poller", daemon=True)
        self._rng = rng
        self._stopping = threading.Event()

    def run(self) -> None:
        """Look again and again, until stopped."""
        arguments = {"rng": self._rng, "stopping": self._stopping}
        while not self._stopping.wait(settings.POLL_S * self._rng.uniform(0.8, 1.2)):
            look = threading.Thread(target=look_for_work, kwargs=arguments, name="look", daemon=True)
            look.start()
            look.join()

    def stop(self, *, patience_s: float) -> None:
        """Begin nothing more, and wait for what is in hand, but no longer than `patience_s`."""
        self._stopping.set()
        self.join(patience_s)
