"""The queue seen from outside: the sweep, and every worker looking for work by itself.

The broker makes things fast; these make them certain. A lost message, a flushed or absent broker, or a killed
beat delays scoring by seconds.
"""

import random
import threading

import structlog
from django.conf import settings
from django.db import DatabaseError, close_old_connections

from leaderboard import health, lifecycle, scoring

log = structlog.get_logger(__name__)

MAX_NUDGES_PER_SWEEP = 100


def sweep(*, rng: random.Random) -> int:
    """Take back what dead workers hold and nudge again what waits. Returns how many nudges were sent."""
    lifecycle.release_expired(rng=rng)
    waiting = lifecycle.waiting_ids(limit=MAX_NUDGES_PER_SWEEP)
    for evaluation_id in waiting:
        lifecycle.nudge(evaluation_id)
    health.record_sweep()
    return len(waiting)


class Poller(threading.Thread):
    """Looks for queued work every few seconds, whether or not a message came."""

    def __init__(self, *, rng: random.Random) -> None:
        super().__init__(name="poller", daemon=True)
        self._rng = rng
        self._stopping = threading.Event()

    def run(self) -> None:
        """Poll until stopped; a database that is away is tried again."""
        while not self._stopping.wait(settings.POLL_S * self._rng.uniform(0.8, 1.2)):
            close_old_connections()
            try:
                self._drain()
            except (DatabaseError, OSError) as fault:
                log.warning("poll_failed", reason=str(fault)[:200])
            finally:
                close_old_connections()

    def _drain(self) -> None:
        lifecycle.release_expired(rng=self._rng)
        while not self._stopping.is_set() and scoring.run_next(rng=self._rng):
            continue

    def stop(self) -> None:
        """Ask the thread to end after what it is doing."""
        self._stopping.set()
