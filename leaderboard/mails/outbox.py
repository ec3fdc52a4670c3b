"""The outbox: keep what the mail server does not take, and send it later.

Mails of accounts are tried at once; others wait for the workers' sweep or `manage.py send_mails`. Each is
sent at least once: a crash between sending and saving sends it again.
"""

import smtplib
from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Final

import structlog
from django.conf import settings
from django.core.mail import EmailMessage
from django.db.models import F
from django.urls import reverse

from leaderboard.models import Mail, MailKind, User

log = structlog.get_logger(__name__)

# What a mail server that is away, or does not want a mail, raises.
FAULTS: Final = (OSError, smtplib.SMTPException)
MAX_AT_ONCE: Final = 50
GIVE_UP_AFTER: Final = timedelta(days=3)
_FIRST_WAIT: Final = timedelta(seconds=30)
_LONGEST_WAIT: Final = timedelta(hours=1)
# Kept so long to know what was told already.
KEPT: Final = timedelta(days=30)


def send_or_keep(*, message: EmailMessage, now: datetime) -> None:
    """Send a mail to one person now, or keep it; never fails."""
    if _sent(message):
        return
    [recipient] = message.to
    Mail.objects.create(
        kind=MailKind.ACCOUNT,
        recipient=recipient,
        subject=message.subject[:250],
        text=str(message.body),
        queued_at=now,
        due_at=now + _FIRST_WAIT,
    )


def notice(*, kind: MailKind, user: User, key: str, subject: str, text: str, now: datetime) -> Mail:
    """Make a notice for `queue`, with a subject of one line."""
    return Mail(
        kind=kind,
        user=user,
        recipient=user.email,
        key=key,
        subject=" ".join(subject.split())[:250],
        text=text,
        queued_at=now,
        due_at=now,
    )


def queue(mails: list[Mail]) -> None:
    """Queue notices; skip known keys."""
    Mail.objects.bulk_create(mails, ignore_conflicts=True)


def waiting() -> int:
    return Mail.objects.filter(ended_at=None).count()


def work_off(*, now: datetime, is_stopping: Callable[[], bool] = lambda: False) -> int:
    """Send what is due, oldest first, until one fails. Returns how many were sent."""
    n_sent = 0
    for mail in Mail.objects.filter(ended_at=None, due_at__lte=now).order_by("due_at")[:MAX_AT_ONCE]:
        if is_stopping():
            break
        wait = min(_FIRST_WAIT * 2**mail.n_tries, _LONGEST_WAIT)
        mine = Mail.objects.filter(pk=mail.pk, n_tries=mail.n_tries, ended_at=None)
        if not mine.update(n_tries=F("n_tries") + 1, due_at=now + wait):
            continue  # somebody else sends it
        message = EmailMessage(mail.subject, mail.text, to=[mail.recipient], headers=_headers(mail))
        is_sent = _sent(message)
        n_sent += is_sent
        if is_sent or mail.queued_at <= now - GIVE_UP_AFTER:
            _end(mail, now=now, is_sent=is_sent)
        if not is_sent:
            break
    return n_sent


def purge(*, now: datetime) -> int:
    """Delete mails that were sent long ago. Returns how many."""
    return Mail.objects.filter(ended_at__lt=now - KEPT).delete()[0]


def _headers(mail: Mail) -> dict[str, str]:
    """Return what mail clients offer to unsubscribe by; nobody can from mails of accounts."""
    if mail.kind == MailKind.ACCOUNT:
        return {}
    return {
        "List-Unsubscribe": f"<{settings.SITE_URL}{reverse('mails')}>",
        "Auto-Submitted": "auto-generated",
    }


def _end(mail: Mail, *, now: datetime, is_sent: bool) -> None:
    # Links in the text open accounts, and addresses are private.
    ended = {"recipient": "", "subject": "", "text": "", "ended_at": now, "is_sent": is_sent}
    Mail.objects.filter(pk=mail.pk).update(**ended)
    if not is_sent:
        log.error("mail_given_up", mail_id=mail.pk, kind=mail.kind, n_tries=mail.n_tries + 1)


def _sent(message: EmailMessage) -> bool:
    try:
        message.send()
    except FAULTS as fault:
        log.warning("mail_not_sent", reason=f"{type(fault).__name__}: {fault}"[:200])
        return False
    return True
