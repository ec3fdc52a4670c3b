"""Faults by mail to `TSTTC_ERROR_EMAILS`, each once an hour.

Named by path in Django's `LOGGING`, so it is imported before there are models.
"""

import hashlib
import logging
from datetime import datetime
from typing import Final

from django.conf import settings
from django.utils import timezone

_HOUR: Final = "%Y%m%d%H"
_MAX_CHARACTERS: Final = 20_000


class FaultReportHandler(logging.Handler):
    """Puts a line of the log into the outbox. A fault there never raises another."""

    def emit(self, record: logging.LogRecord) -> None:
        try:
            self._queue(self.format(record), origin=f"{record.name}:{record.lineno}", now=timezone.now())
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
