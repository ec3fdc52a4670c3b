"""Sweep and pollers: every worker looks for work by itself.

The broker makes things fast; these make them certain. A lost message, or a flushed or absent broker, delays
scoring by seconds.
"""

import random
import threading
import time
from collections.abc import Callable, Sequence

import structlog
from django.conf import settings
from django.db import Error, connections
from django.db.models import BooleanField, ExpressionWrapper, Q
from django.db.models.functions import Now

from leaderboard import audit, versions
from leaderboard.db import clock
from leaderboard.mails import notices, outbox
from leaderboard.methods import visibility
from leaderboard.models import Evaluation, SweepBeat
from leaderboard.ops import health, rate_limits
from leaderboard.scoring import analyses, lifecycle, worker
from leaderboard.storage import truth_values
from leaderboard.workers import backlog, upkeep

log = structlog.get_logger(__name__)


# --- what a worker process does every few seconds ---------------------------------------------------------


def poll(*, rng: random.Random, stopping: threading.Event) -> int:
    """Take back what dead workers hold, then decide what waits until nothing does, or until `stopping`.

    Then what waits behind submissions. Returns how often one was decided.
    """
    n_found = 0
    lifecycle.release_expired(rng=rng)
    while not stopping.is_set() and worker.run_next(rng=rng):
        n_found += 1
    work_behind(rng=rng, stopping=stopping)
    return n_found


def work_behind(*, rng: random.Random, stopping: threading.Event) -> int:
    """Do what waits behind submissions, until `stopping`. Returns how much was done."""
    if stopping.is_set():
        return 0
    return backlog.work_off(now=clock.database_now(), rng=rng, is_stopping=stopping.is_set)


def sweep_if_due(*, rng: random.Random, stopping: threading.Event) -> None:
    """Sweep, unless somebody has begun to within `SWEEP_S`."""
    if _begun("sweep_begun_at", every_s=settings.SWEEP_S):
        sweep(rng=rng)


def clean_if_due(*, rng: random.Random, stopping: threading.Event) -> None:
    """Clean, unless somebody has begun to within `CLEAN_S`."""
    if _begun("clean_begun_at", every_s=settings.CLEAN_S):
        upkeep.clean(now=clock.database_now())


def send_mails_if_due(*, rng: random.Random, stopping: threading.Event) -> None:
    """Queue notices and send what waits, unless somebody has begun to within `SWEEP_S`.

    A worker that has no mail server leaves it to others.
    """
    if settings.SENDS_MAIL and _begun("mails_begun_at", every_s=settings.SWEEP_S):
        now = clock.database_now()
        notices.queue_due(now=now)
        outbox.work_off(now=now, is_stopping=stopping.is_set)


def _begun(field: str, *, every_s: float) -> bool:
    """Whether it is due and this process is the one to do it: of all that ask at once, one."""
    is_due = Q(**{field: None}) | Q(**{f"{field}__lte": clock.after(-every_s)})
    # Looked at first: an update, also one of no row, waits for SQLite's one writer.
    found = SweepBeat.objects.values_list(ExpressionWrapper(is_due, BooleanField()), flat=True).first()
    if found is None:
        SweepBeat.objects.bulk_create([SweepBeat()], ignore_conflicts=True)
    return found is not False and bool(SweepBeat.objects.filter(is_due).update(**{field: Now()}))


def sweep(*, rng: random.Random) -> None:
    """Take back what dead workers hold, and do what is due by the clock.

    A worker that cannot read the ground truth of what waits leaves it to others, and says so.
    """
    lifecycle.release_expired(rng=rng)
    visibility.reveal_due(now=clock.database_now())
    versions.times_passed(now=clock.database_now())
    analyses.delete_hidden()
    rate_limits.purge_expired(now=clock.database_now())
    due = Evaluation.objects.due()
    n_out_of_reach = due.count() - due.scorable(truth_values.readable_digests()).count()
    if n_out_of_reach:
        log.error("ground_truth_out_of_reach", n_waiting=n_out_of_reach)
    audit.seal()
    health.record_sweep(n_out_of_reach=n_out_of_reach)


# --- the threads that do it -------------------------------------------------------------------------------


class Poller(threading.Thread):
    """Does something every few seconds, whether or not a message came.

    Each time in a thread of its own with connections of its own: whatever goes wrong in one, the next starts
    afresh.
    """

    def __init__(self, act: Callable[..., object], *, every_s: float, rng: random.Random) -> None:
        super().__init__(name=act.__name__, daemon=True)
        self._act = act
        self._every_s = every_s
        self._rng = rng
        self._stopping = threading.Event()

    def run(self) -> None:
        """Do it again and again, until stopped."""
        while not self._stopping.wait(self._every_s * self._rng.uniform(0.8, 1.2)):
            once = threading.Thread(target=self._once, name=self.name, daemon=True)
            once.start()
            once.join()

    def _once(self) -> None:
        """Do it. A database or store that is away is no fault of this time; the next one finds it."""
        try:
            self._act(rng=self._rng, stopping=self._stopping)
        except (Error, OSError) as fault:
            log.warning("poll_failed", act=self.name, reason=str(fault)[:200])
        finally:
            # They belong to this thread, which ends here.
            connections.close_all()

    def stop(self) -> None:
        """Begin nothing more."""
        self._stopping.set()


def start_pollers(*, rng: random.Random) -> Sequence[Poller]:
    """Let this process look for work, sweep, clean and send mails by itself.

    One for each, so that neither a long run nor a slow store keeps the queue from being swept.
    """
    pollers = (
        Poller(poll, every_s=settings.POLL_S, rng=rng),
        Poller(sweep_if_due, every_s=settings.SWEEP_S / 3, rng=rng),
        Poller(clean_if_due, every_s=min(settings.CLEAN_S, 60.0), rng=rng),
        Poller(send_mails_if_due, every_s=settings.SWEEP_S / 3, rng=rng),
    )
    for poller in pollers:
        poller.start()
    return pollers


def stop_pollers(pollers: Sequence[Poller], *, patience_s: float) -> None:
    """Begin nothing more, and wait for what is in hand, but no longer than `patience_s`."""
    ends_s = time.monotonic() + patience_s
    for poller in pollers:
        poller.stop()
    for poller in pollers:
        poller.join(max(ends_s - time.monotonic(), 0.0))
