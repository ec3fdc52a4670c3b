"""The record of backups: when each began and ended, and why it failed."""

from datetime import datetime, timedelta
from typing import Final

from django.conf import settings
from django.db.models import Q, QuerySet

from leaderboard.models import BackupRun

KEPT: Final = timedelta(days=400)
# A run without an end was killed if it began so long ago.
LONGEST: Final = timedelta(hours=12)
_MAX_CHARACTERS: Final = 2_000


def begin(now: datetime) -> BackupRun:
    """Record that a backup begins, and forget runs older than `KEPT`. Raises the database's error."""
    good = last_good()
    is_kept = Q(pk=good.pk) if good else Q(pk=None)
    BackupRun.objects.filter(started_at__lt=now - KEPT).exclude(is_kept).delete()
    return BackupRun.objects.create(started_at=now)


def finish(
    run: BackupRun,
    *,
    now: datetime,
    is_ok: bool,
    n_files: int = 0,
    n_damaged: int = 0,
    n_lost: int = 0,
    fault: str = "",
) -> None:
    """Record how a backup ended. Raises the database's error."""
    run.finished_at = now
    run.is_ok = is_ok
    run.n_files = n_files
    run.n_damaged = n_damaged
    run.n_lost = n_lost
    run.fault = fault[:_MAX_CHARACTERS]
    run.save()


def last_good(*, using: str = "default") -> BackupRun | None:
    """Return the latest good backup."""
    return BackupRun.objects.using(using).filter(is_ok=True).order_by("-finished_at").first()


def failed_since_good(*, now: datetime, using: str = "default") -> QuerySet[BackupRun]:
    """Return the backups since the last good one that ended badly, or never ended; the latest first.

    One that ended before the good one did is of no interest, such as a second one that was refused meanwhile.
    """
    good = last_good(using=using)
    since = Q(started_at__gt=good.started_at) if good else Q()
    if good:
        since &= Q(finished_at=None) | Q(finished_at__gt=good.finished_at)
    is_over = ~Q(finished_at=None) | Q(started_at__lt=now - LONGEST)
    return BackupRun.objects.using(using).filter(since, is_over, is_ok=False).order_by("-started_at")


def is_overdue(*, now: datetime, using: str = "default") -> bool:
    """Say whether the last good backup is older than `TSTTC_MAX_BACKUP_AGE_H`.

    A site that never made a backup has none to miss. One whose backups all failed misses one.
    """
    if not settings.MAX_BACKUP_AGE_H:
        return False
    good = last_good(using=using)
    since = good.finished_at if good else None
    if good is None:
        first = BackupRun.objects.using(using).order_by("started_at").first()
        since = first.started_at if first else None
    return since is not None and since < now - timedelta(hours=settings.MAX_BACKUP_AGE_H)
