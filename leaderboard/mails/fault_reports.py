"""Faults by mail to `TSTTC_ERROR_EMAILS`, each once an hour.

Two lines tell of the same fault if they have the same exception, raised at the same place. Without an
exception, the line of our code that logs it and what it is about decide.

Named by path in Django's `LOGGING`, so it is imported before there are models.
"""

import hashlib
import logging
import sys
import traceback
from datetime import datetime
from typing import Any, Final

from django.conf import settings
from django.utils import timezone

MONITORED: Final = frozenset({"/healthz", "/readyz", "/healthy", "/metrics"})
_HOUR: Final = "%Y%m%d%H"
# Django logs there that it refuses a request, such as one with a wrong Host: no fault of the site.
_OF_VISITORS: Final = "django.security."
_MAX_CHARACTERS: Final = 20_000


# Of an event, what says which fault it is: others, such as a reason or an id, differ each time.
_TELLING: Final = ("event", "code", "kind", "subject")


def origin_of(record: logging.LogRecord) -> str:
    """Name the fault that a line tells of."""
    event = record.msg if isinstance(record.msg, dict) else {}
    fault = _exception(event.get("exc_info") or record.exc_info)
    if fault is not None:
        frames = traceback.extract_tb(fault.__traceback__)
        raised_at = f"{frames[-1].filename}:{frames[-1].lineno}" if frames else ""
        return f"{type(fault).__qualname__} {raised_at}"
    # A probe that fails is a fault of its own; elsewhere visitors choose the address.
    address = str(event.get("request", "")).partition(" ")[2]
    values = [str(event.get(name, "")) for name in _TELLING]
    return " ".join([f"{record.name}:{record.lineno}", *values, address if address in MONITORED else ""])


def _exception(exc_info: Any) -> BaseException | None:
    """Return the exception of logging's or structlog's `exc_info`, which may say "the present one"."""
    if isinstance(exc_info, BaseException):
        return exc_info
    if isinstance(exc_info, tuple):
        return exc_info[1]
    return sys.exception() if exc_info else None


class FaultReportHandler(logging.Handler):
    """Puts a line of the log into the outbox. A fault there never raises another."""

    def emit(self, record: logging.LogRecord) -> None:
        if record.name.startswith(_OF_VISITORS):
            return
        try:
            self._queue(self.format(record), origin=origin_of(record), now=timezone.now())
        except Exception:  # noqa: BLE001 - logging's own rule: whatever fails, the caller goes on
            self.handleError(record)

    def _queue(self, line: str, *, origin: str, now: datetime) -> None:
        from leaderboard.models import Mail, MailKind  # noqa: PLC0415 - logging is set up before the models

        for address in settings.ERROR_EMAILS:
            digest = hashlib.sha256(f"{origin}{now:{_HOUR}}{address}".encode()).hexdigest()
            mail = Mail(
                kind=MailKind.ACCOUNT,
                recipient=address,
                subject=f"[{settings.BENCHMARK.site_name}] An error on the site",
                text=line[:_MAX_CHARACTERS],
                key=f"error:{digest[:60]}",
                queued_at=now,
                due_at=now,
            )
            Mail.objects.bulk_create([mail], ignore_conflicts=True)
