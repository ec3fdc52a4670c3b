"""The queue seen from outside: the sweep, and every worker looking for work by itself.

The broker makes things fast; these make them certain. A lost message, a flushed or absent broker, or a killed
beat delays scoring by seconds.
"""

import random
import threading

import structlog
from django.conf import settings
from django.db import Error, connections

from leaderboard import broker, health, lifecycle, scoring

log = structlog.get_logger(__name__)

MAX_NUDGES_PER_SWEEP = 100


def sweep(*, rng: random.Random) -> int:
    """Take back what dead workers hold and nudge again what waits. Returns how many nudges were sent."""
    lifecycle.release_expired(rng=rng)
    n_sent = 0
    for evaluation_id in lifecycle.waiting_ids(limit=MAX_NUDGES_PER_SWEEP):
        if not broker.nudge(evaluation_id):
            # A broker that does not answer takes seconds to say so, each time.
            break
        n_sent += 1
    health.record_sweep()
    return n_sent


def look_for_work(*, rng: random.Random, stopping: threading.Event) -> int:
    """Take back what dead workers hold, then decide what waits until nothing does, or until `stopping`.

    Returns how often there was something. A database that is away is no fault of this look; the next one
    finds it.
    """
    n_found = 0
    try:
        lifecycle.release_expired(rng=rng)
        while not stopping.is_set() and scoring.run_next(rng=rng):
            n_found += 1
    except (Error, OSError) as fault:
        log.warning("look_failed", reason=str(fault)[:200])
    finally:
        # They belong to the thread that looked, which ends here.
        connections.close_all()
    return n_found


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
