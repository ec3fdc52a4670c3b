"""Sweep and pollers: every worker looks for work by itself, so a lost message delays scoring by seconds."""

import random
import threading
import time
from collections.abc import Callable, Sequence
from datetime import datetime

import structlog
from django.conf import settings
from django.db import Error, connections
from django.db.models import Q
from django.db.models.functions import Now

from leaderboard import audit, board_versions
from leaderboard.db import clock
from leaderboard.mails import notices, outbox
from leaderboard.methods import visibility
from leaderboard.models import Evaluation, SweepBeat
from leaderboard.moderation import forgetting, takeovers
from leaderboard.ops import health, rate_limits
from leaderboard.people import addresses, sessions
from leaderboard.queue import lifecycle, worker
from leaderboard.quotas import mailboxes
from leaderboard.statistics import analyses
from leaderboard.storage import asked, orphans, truth_values
from leaderboard.upkeep import backlog, store_check

log = structlog.get_logger(__name__)


# --- what a worker process does every few seconds ---------------------------------------------------------


def poll(*, rng: random.Random, stopping: threading.Event) -> int:
    """Take back expired leases, decide what waits until `stopping`, then do low-priority jobs.

    Returns how many evaluations were decided.
    """
    n_decided = 0
    lifecycle.release_expired(rng=rng)
    while not stopping.is_set() and worker.run_next(rng=rng):
        n_decided += 1
    if not stopping.is_set():
        backlog.work_off(now=clock.database_now(), rng=rng, is_stopping=stopping.is_set)
    return n_decided


def keep_up(*, rng: random.Random, stopping: threading.Event) -> None:
    """Sweep, send mails, check the store and clean, each when it is due and no other process has begun to."""
    SweepBeat.objects.get_or_create(pk=SweepBeat.THE_ONE)
    if _begun("sweep_begun_at", every_s=settings.SWEEP_S):
        sweep(rng=rng)
    # A worker that has no mail server leaves mails to others.
    if settings.SENDS_MAIL and _begun("mails_begun_at", every_s=settings.SWEEP_S):
        now = clock.database_now()
        notices.queue_due(now=now)
        outbox.work_off(now=now, is_stopping=stopping.is_set)
    if _begun("store_begun_at", every_s=store_check.EVERY_S):
        store_check.check(now=clock.database_now())
    if _begun("clean_begun_at", every_s=settings.CLEAN_S):
        clean(now=clock.database_now())


def _begun(field: str, *, every_s: float) -> bool:
    """Claim a due task for this process by compare-and-set."""
    due = SweepBeat.objects.filter(Q(**{field: None}) | Q(**{f"{field}__lte": clock.after(-every_s)}))
    # Looked at first: an update, also one of no row, waits for SQLite's one writer.
    return due.exists() and bool(due.update(**{field: Now()}))


def sweep(*, rng: random.Random) -> None:
    """Take back expired leases, and do what is due by the clock."""
    lifecycle.release_expired(rng=rng)
    visibility.reveal_due(now=clock.database_now())
    board_versions.bump_passed_deadlines(now=clock.database_now())
    analyses.delete_hidden()
    rate_limits.purge_expired(now=clock.database_now())
    due = Evaluation.objects.due()
    n_out_of_reach = due.count() - due.scorable(truth_values.readable_digests()).count()
    if n_out_of_reach:
        log.error("ground_truth_out_of_reach", n_waiting=n_out_of_reach)
    health.record_sweep(n_out_of_reach=n_out_of_reach)
    # Last, and on its own: an event that cannot be sealed keeps nothing else from being done. Health and
    # metrics tell how long the oldest one waits.
    try:
        audit.seal()
    except Exception:
        log.exception("audit_not_sealed")


def clean(*, now: datetime) -> None:
    """Remove expired rows and orphaned files; safe in several workers. Raises `OSError` of the store."""
    outbox.purge(now=now)
    mailboxes.delete_expired(now=now)
    forgetting.delete_late_rows()
    addresses.delete_unproved(now=now)
    takeovers.delete_old(now=now)
    sessions.clear_expired()
    n_files = n_bytes = n_leftovers = 0
    faults: list[OSError] = []
    for orphan in orphans.orphans(now=now):
        try:
            is_removed = orphans.remove(orphan, now=now)
        except OSError as fault:
            # One file that cannot be removed keeps no other.
            faults.append(fault)
            continue
        if is_removed:
            n_files, n_bytes = n_files + 1, n_bytes + orphan.size_bytes
    asked.remove_old(now=now)
    # Half-written files of processes that were killed.
    for path in orphans.leftovers():
        path.unlink(missing_ok=True)
        n_leftovers += 1
    if faults:
        raise faults[0]
    SweepBeat.objects.update(cleaned_at=now)
    log.info("cleaned", n_files=n_files, n_bytes=n_bytes, n_leftovers=n_leftovers)


# --- the threads that do it -------------------------------------------------------------------------------


class Poller(threading.Thread):
    """Does something every few seconds, with new database connections each time."""

    def __init__(self, act: Callable[..., object], *, every_s: float, rng: random.Random) -> None:
        super().__init__(name=act.__name__, daemon=True)
        self._act = act
        self._every_s = every_s
        self._rng = rng
        self._stopping = threading.Event()

    def run(self) -> None:
        while not self._stopping.wait(self._every_s * self._rng.uniform(0.8, 1.2)):
            try:
                self._act(rng=self._rng, stopping=self._stopping)
            except (Error, OSError) as fault:
                # A database or store that is away is no fault of this time; the next one finds it.
                log.warning("poll_failed", act=self.name, reason=str(fault)[:200])
            except Exception:
                log.exception("poll_failed", act=self.name)
            finally:
                connections.close_all()

    def stop(self) -> None:
        self._stopping.set()


def start_pollers(*, rng: random.Random) -> Sequence[Poller]:
    """Start two threads, so that a long run does not delay the sweep."""
    pollers = (
        Poller(poll, every_s=settings.POLL_S, rng=rng),
        Poller(keep_up, every_s=settings.SWEEP_S / 3, rng=rng),
    )
    for poller in pollers:
        poller.start()
    return pollers


def stop_pollers(pollers: Sequence[Poller], *, timeout_s: float) -> None:
    """Stop the pollers and wait for the task of each, at most `timeout_s` in all."""
    ends_s = time.monotonic() + timeout_s
    for poller in pollers:
        poller.stop()
    for poller in pollers:
        poller.join(max(ends_s - time.monotonic(), 0.0))
