"""The record of backups: when each began and ended, and why it failed."""

from datetime import datetime, timedelta
from typing import Final

from django.db.models import Q

from leaderboard.models import BackupRun

KEPT: Final = timedelta(days=400)
_MAX_CHARACTERS: Final = 2_000


def begin(now: datetime) -> BackupRun:
    """Record that a backup begins, and forget runs older than `KEPT`. Raises the database's error."""
    good = last_good()
    is_kept = Q(pk=good.pk) if good else Q(pk=None)
    BackupRun.objects.filter(started_at__lt=now - KEPT).exclude(is_kept).delete()
    return BackupRun.objects.create(started_at=now)


def finish(
    run: BackupRun, *, now: datetime, is_ok: bool, n_files: int = 0, n_damaged: int = 0, fault: str = ""
) -> None:
    """Record how a backup ended. Raises the database's error."""
    run.finished_at = now
    run.is_ok = is_ok
    run.n_files = n_files
    run.n_damaged = n_damaged
    run.fault = fault[:_MAX_CHARACTERS]
    run.save()


def last_good(*, using: str = "default") -> BackupRun | None:
    """Return the latest good backup."""
    return BackupRun.objects.using(using).filter(is_ok=True).order_by("-finished_at").first()


def last_failed(*, using: str = "default") -> BackupRun | None:
    """Return the latest backup that ended badly after the last good one began."""
    good = last_good(using=using)
    since = Q(started_at__gt=good.started_at) if good else Q()
    failed = BackupRun.objects.using(using).filter(since, is_ok=False).exclude(finished_at=None)
    return failed.order_by("-started_at").first()
