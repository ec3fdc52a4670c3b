"""Upkeep: remove files that no submission names and rows that have expired."""

from dataclasses import dataclass
from datetime import datetime

import structlog

from leaderboard.mails import outbox
from leaderboard.models import SweepBeat
from leaderboard.people import addresses
from leaderboard.quotas import mailboxes
from leaderboard.storage import orphans
from leaderboard.submissions import forgetting

log = structlog.get_logger(__name__)


@dataclass(frozen=True)
class Cleaned:
    """What was removed."""

    n_files: int
    n_bytes: int
    n_leftovers: int  # half-written files of processes that were killed


def clean(*, now: datetime) -> Cleaned:
    """Remove what nobody needs. Several may do it at once; each file is removed by one of them.

    Raises `OSError` if the store does not answer; what was removed until then stays removed.
    """
    outbox.purge(now=now)
    mailboxes.delete_expired(now=now)
    forgetting.delete_late_rows()
    addresses.delete_unproved(now=now)
    n_files = n_bytes = n_leftovers = 0
    for orphan in orphans.orphans(now=now):
        if orphans.remove(orphan, now=now):
            n_files, n_bytes = n_files + 1, n_bytes + orphan.size_bytes
    for path in orphans.leftovers():
        path.unlink(missing_ok=True)
        n_leftovers += 1
    SweepBeat.objects.update(cleaned_at=now)
    cleaned = Cleaned(n_files, n_bytes, n_leftovers)
    log.info("cleaned", **vars(cleaned))
    return cleaned
