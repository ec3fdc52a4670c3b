"""Faults that last: when each began, how often it came, and the last reason.

A worker or a web process notes a fault, and clears it with the first success. Health, metrics and the
maintainers' hub read the rows.
"""

from collections.abc import Collection
from datetime import datetime, timedelta
from typing import Final

from django.db.models import F, QuerySet

from leaderboard.models import Fault

STORE: Final = "file store"
UPLOADS: Final = "uploads"
MAIL: Final = "mail server"
LABEL_CHANGES: Final = "label changes"
COMPARISONS: Final = "comparisons"
INTERVALS: Final = "intervals"
ANALYSES: Final = "analyses"
STATISTICS: Final = (LABEL_CHANGES, COMPARISONS, INTERVALS, ANALYSES)
KINDS: Final = (STORE, UPLOADS, MAIL, *STATISTICS)
STRIKES: Final = "strikes"
"""Only counted: a failed run is no fault that lasts. Its subject is the kind of strike."""

# A try comes every few seconds; what nobody tries any more, such as a withdrawn file, is no fault.
FORGOTTEN_AFTER: Final = timedelta(hours=6)
# A job that failed once is tried again at once, and a lock or a restart is no fault.
MIN_TIMES: Final = 3


def note(kind: str, *, now: datetime, reason: str, subject: str = "") -> bool:
    """Count a failure. Returns whether the fault is a new one. Raises the database's error."""
    row, _ = Fault.objects.get_or_create(kind=kind, subject=subject[:120])
    rows = Fault.objects.filter(pk=row.pk)
    is_new = row.began_at is None or row.last_at is None or row.last_at < now - FORGOTTEN_AFTER
    if is_new:
        rows.update(began_at=now, n_times=0)
    rows.update(last_at=now, n_times=F("n_times") + 1, n_ever=F("n_ever") + 1, reason=reason[:500])
    return is_new


def clear(kind: str, *, subject: str = "") -> None:
    """End a fault, if there is one. Raises the database's error."""
    rows = Fault.objects.filter(kind=kind, subject=subject[:120])
    rows.exclude(began_at=None).update(began_at=None, n_times=0)


def present(
    kinds: Collection[str] = KINDS, *, now: datetime, min_times: int = 1, using: str = "default"
) -> QuerySet[Fault]:
    """Return the faults that last, the oldest first."""
    rows = Fault.objects.using(using).filter(kind__in=kinds, n_times__gte=min_times)
    return rows.filter(last_at__gte=now - FORGOTTEN_AFTER).exclude(began_at=None).order_by("began_at", "pk")
