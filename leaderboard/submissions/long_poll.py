"""Long polling: wait for a submission's change without holding the server's threads.

A process has so many places (`settings.WAITERS`); gunicorn gives it as many threads beside those that serve
everybody else, so waiters starve nobody. Whoever finds no place is told at once when to ask again. All
waiters of a process share one watcher, which asks the database for all of them together; a waiter itself
holds no connection.
"""

import math
import random
import threading
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from uuid import UUID

import structlog
from django.conf import settings
from django.db import Error, connection, connections
from django.db.models import Prefetch

from leaderboard.models import Evaluation, Submission
from leaderboard.submissions import submissions

log = structlog.get_logger(__name__)

MAX_WAIT_S = 60
LOOK_EVERY_S = 0.5
# So many waiters make one look worth that pause; for fewer it is shorter, down to a fifth for one.
FULL_PAUSE_FROM = 5
# Those without a place are spread so that about so many of them ask a process per second.
TURNED_AWAY_PER_S = 4
LONGEST_RETRY_AFTER_S = 60


def final_among(ids: Collection[UUID]) -> set[UUID]:
    """Which of these submissions will not change any more: two queries, however many they are."""
    evaluations = Evaluation.objects.select_related("edition").defer("report", "problems")
    rows = (
        Submission.objects.filter(pk__in=ids)
        .select_related("split")
        .prefetch_related(Prefetch("evaluations", evaluations))
    )
    found = {row.pk: submissions.evaluation_of(row).is_final for row in rows}
    # What is gone will not change either.
    return {pk for pk in ids if found.get(pk, True)}


@dataclass(eq=False)
class _Place:
    """Somebody who waits. `is_gone` asks whether the connection to them is closed."""

    submission_id: UUID
    is_gone: Callable[[], bool]
    is_over: threading.Event = field(default_factory=threading.Event)


class Watcher:
    """The places of one process, and the thread that looks for all who have one. It lives while any is taken.

    It looks every `every_s` seconds, more often where few wait. `look` says which of some submissions are
    final; `n_places` is asked each time, so that settings hold.
    """

    def __init__(
        self, *, look: Callable[[Collection[UUID]], set[UUID]], n_places: Callable[[], int], every_s: float
    ) -> None:
        self._look = look
        self._n_places = n_places
        self._every_s = every_s
        self._lock = threading.Lock()
        self._places: list[_Place] = []
        self._thread: threading.Thread | None = None
        self._closing = threading.Event()
        self._turned_away: dict[UUID, float] = {}

    def hold(
        self,
        submission_id: UUID,
        *,
        wait_s: float,
        is_gone: Callable[[], bool],
        prepare: Callable[[], None] = lambda: None,
    ) -> bool:
        """Return once the submission is final, `wait_s` is over, or the asker is gone.

        Returns False at once where no place is free, or the process is about to end; else `prepare` is called
        before the wait.
        """
        place = _Place(submission_id, is_gone)
        with self._lock:
            if self._closing.is_set() or len(self._places) >= self._n_places():
                self._note(submission_id)
                return False
            self._turned_away.pop(submission_id, None)
            self._places.append(place)
            if self._thread is None:
                self._thread = threading.Thread(target=self._watch, name="watcher", daemon=True)
                self._thread.start()
        try:
            prepare()
            place.is_over.wait(wait_s)
        finally:
            with self._lock:
                self._places.remove(place)
        return True

    def retry_after_s(self, *, rng: random.Random) -> int:
        """When somebody without a place may ask again: the later, the more of them there are."""
        with self._lock:
            n_asking = len(self._turned_away)
        wait_s = n_asking / TURNED_AWAY_PER_S * rng.uniform(0.8, 1.2)
        return max(1, min(LONGEST_RETRY_AFTER_S, math.ceil(wait_s)))

    def close(self) -> None:
        """Let everybody go with the present state, and take nobody any more: the process is about to end.

        Takes no lock, for it is called from a signal handler.
        """
        self._closing.set()

    def _note(self, submission_id: UUID) -> None:
        now_s = time.monotonic()
        # Anew at the end, so that the first one is always the oldest.
        self._turned_away.pop(submission_id, None)
        self._turned_away[submission_id] = now_s
        since_s = now_s - 2 * LONGEST_RETRY_AFTER_S
        while self._turned_away:
            oldest = next(iter(self._turned_away))
            if self._turned_away[oldest] >= since_s:
                break
            del self._turned_away[oldest]

    def _watch(self) -> None:
        try:
            # Looks before it waits, so that it never asks for somebody who has left meanwhile.
            while places := self._taken():
                self._release(places)
                self._closing.wait(self._every_s * min(1.0, len(places) / FULL_PAUSE_FROM))
        except (Error, OSError) as fault:
            # Those who wait ask the database themselves then, and tell whoever asked what is wrong with it.
            log.warning("watch_failed", reason=str(fault)[:200])
        finally:
            self._end()
            connections.close_all()

    def _taken(self) -> list[_Place]:
        """Who waits; the watcher ends where nobody does, and whoever comes then starts another one."""
        with self._lock:
            if not self._places:
                self._thread = None
            return list(self._places)

    def _end(self) -> None:
        with self._lock:
            # Otherwise nobody waited any more, and whoever came since has a watcher of their own.
            if self._thread is threading.current_thread():
                self._thread = None
                for place in self._places:
                    place.is_over.set()

    def _release(self, places: list[_Place]) -> None:
        is_closing = self._closing.is_set()
        final = set() if is_closing else self._look({place.submission_id for place in places})
        for place in places:
            if is_closing or place.submission_id in final or place.is_gone():
                place.is_over.set()


THE_WATCHER = Watcher(look=final_among, n_places=lambda: settings.WAITERS, every_s=LOOK_EVERY_S)


def wait(submission_id: UUID, *, wait_s: float, is_gone: Callable[[], bool]) -> bool:
    """`Watcher.hold` at a place of this process, with the thread's database connection closed meanwhile.

    Who finds no place keeps it: a new one costs the database more than the answer does.
    """
    return THE_WATCHER.hold(submission_id, wait_s=wait_s, is_gone=is_gone, prepare=_let_go_of_the_database)


def _let_go_of_the_database() -> None:
    if not connection.in_atomic_block:
        connection.close()
