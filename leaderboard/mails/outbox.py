"""The outbox: keep what the mail server does not take, and send it later.

Mails of accounts are tried at once; others wait for the workers' sweep or `manage.py send_mails`. Each is
sent at least once: a crash between sending and saving sends it again. A mail that the server refuses for
good ends, one that it puts off waits alone, and only a fault of the connection stops a run. A refusal that
may concern every mail, such as "Relay access denied", ends a mail only if the server takes another one in
the same run.
"""

from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from typing import Any, Final

import structlog
from django.conf import settings
from django.core.mail import EmailMessage, get_connection
from django.db.models import F, QuerySet
from django.urls import reverse

from leaderboard.mails.delivery import (
    FAULTS,
    Delivery,
    Outcome,
    blames_one_mail,
    deliver,
    no_connection,
)
from leaderboard.models import Mail, MailKind, User
from leaderboard.ops import faults
from leaderboard.ops.logs import without_secrets

log = structlog.get_logger(__name__)

MAX_AT_ONCE: Final = 50
GIVE_UP_AFTER: Final = timedelta(days=3)
_FIRST_WAIT: Final = timedelta(seconds=30)
_LONGEST_WAIT: Final = timedelta(hours=1)
# Connections that break while a mail is sent: after so many the server is taken to be away.
_MAX_BROKEN: Final = 3
# Kept so long to know what was told already.
KEPT: Final = timedelta(days=30)


def send_or_keep(*, message: EmailMessage, now: datetime) -> None:
    """Send a mail to one person now, or keep it; never fails. What is refused for good is listed."""
    send_or_keep_all(messages=[message], now=now)


def send_or_keep_all(*, messages: Sequence[EmailMessage], now: datetime) -> None:
    """Send mails to one person each, as `send_or_keep`, and wait for an absent server once only."""
    delivery = Delivery(Outcome.SENT)
    for message in messages:
        delivery = delivery if delivery.outcome is Outcome.NO_CONNECTION else deliver(message)
        if delivery.outcome is not Outcome.SENT:
            _keep(message, delivery=delivery, now=now)


def _keep(message: EmailMessage, *, delivery: Delivery, now: datetime) -> None:
    [recipient] = message.to
    mail = Mail.objects.create(
        kind=MailKind.ACCOUNT,
        recipient=recipient,
        subject=message.subject[:250],
        text=str(message.body),
        queued_at=now,
        due_at=now + _FIRST_WAIT,
        n_tries=1,
        reason=_kept_reason(delivery),
    )
    if delivery.outcome is Outcome.REFUSED:
        _end(mail, now=now, delivery=delivery)


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


def put_off() -> QuerySet[Mail]:
    """Return the waiting mails that the server has put off, the oldest first."""
    return Mail.objects.filter(ended_at=None).exclude(reason="").order_by("queued_at", "pk")


def unsent() -> QuerySet[Mail]:
    """Return the mails that were refused or given up, the newest first; `purge` deletes them."""
    return Mail.objects.exclude(ended_at=None).filter(is_sent=False).order_by("-ended_at", "-pk")


def work_off(*, now: datetime, is_stopping: Callable[[], bool] = lambda: False) -> int:
    """Send what is due, oldest first, until there is no connection. Returns how many were sent."""
    tried: list[tuple[Mail, Delivery]] = []
    due = list(Mail.objects.filter(ended_at=None, due_at__lte=now).order_by("due_at")[:MAX_AT_ONCE])
    connection = get_connection()
    try:
        for mail in due:
            # It may be one mail that the server breaks off at, so the next ones are tried as well.
            if is_stopping() or len(_with(Outcome.NO_CONNECTION, tried)) == _MAX_BROKEN:
                break
            try:
                connection.open()
            except FAULTS as fault:
                tried.append((mail, no_connection(fault)))
                _put_off_all(now=now, delivery=no_connection(fault))
                break
            if not _claimed(mail, now=now):
                continue  # somebody else sends it
            message = EmailMessage(mail.subject, mail.text, to=[mail.recipient], headers=_headers(mail))
            delivery = deliver(message, connection=connection)
            tried.append((mail, delivery))
            _note(mail, now=now, delivery=delivery)
            if delivery.outcome is not Outcome.SENT:
                _close(connection)
                connection = get_connection()
    finally:
        _close(connection)
    _note_server(tried, now=now)
    return len(_with(Outcome.SENT, tried))


def _with(outcome: Outcome, tried: list[tuple[Mail, Delivery]]) -> list[tuple[Mail, Delivery]]:
    return [(mail, delivery) for mail, delivery in tried if delivery.outcome is outcome]


def _note_server(tried: list[tuple[Mail, Delivery]], *, now: datetime) -> None:
    """Say whether the mail server takes mails at all, by what came of a run; end what it refuses alone."""
    refused = _with(Outcome.REFUSED_PERHAPS_ALL, tried)
    broken = _with(Outcome.NO_CONNECTION, tried)
    deferred = [
        (mail, each) for mail, each in _with(Outcome.PUT_OFF, tried) if not blames_one_mail(each.reason)
    ]
    if _with(Outcome.SENT, tried):
        faults.clear(faults.MAIL)
        for mail, delivery in refused:
            _end(mail, now=now, delivery=Delivery(Outcome.REFUSED, delivery.reason))
    elif broken or ((refused or deferred) and len(_recipients_of_a_fault()) > 1):
        _, last = (broken or refused or deferred)[-1]
        # It names the recipient, whose mail may be sent later.
        reason = without_secrets(last.reason)
        if faults.note(faults.MAIL, reason=reason, now=now):
            # A line that is mailed to people would wait as well.
            log.warning("mail_server_takes_nothing", reason=reason)


def _recipients_of_a_fault() -> set[str]:
    """Return who waits because of an answer that may concern every mail."""
    rows = put_off().values_list("recipient", "reason")
    return {recipient for recipient, reason in rows if not blames_one_mail(reason)}


def _claimed(mail: Mail, *, now: datetime) -> bool:
    wait = min(_FIRST_WAIT * 2 ** min(mail.n_tries, 10), _LONGEST_WAIT)
    mine = Mail.objects.filter(pk=mail.pk, n_tries=mail.n_tries, ended_at=None)
    return bool(mine.update(n_tries=F("n_tries") + 1, due_at=now + wait))


def _note(mail: Mail, *, now: datetime, delivery: Delivery) -> None:
    is_given_up = mail.queued_at <= now - GIVE_UP_AFTER
    if is_given_up or delivery.outcome in {Outcome.SENT, Outcome.REFUSED}:
        _end(mail, now=now, delivery=delivery)
    else:
        Mail.objects.filter(pk=mail.pk).update(reason=_kept_reason(delivery))


def _kept_reason(delivery: Delivery) -> str:
    # Empty while the mail waits for the server alone, which is what the age of the oldest tells.
    return "" if delivery.outcome is Outcome.NO_CONNECTION else delivery.reason


def _put_off_all(*, now: datetime, delivery: Delivery) -> None:
    """Give up what has waited for days for a server that is away."""
    log.warning("mail_server_away", reason=delivery.reason)
    for mail in Mail.objects.filter(ended_at=None, due_at__lte=now, queued_at__lte=now - GIVE_UP_AFTER):
        _end(mail, now=now, delivery=delivery)


def _close(connection: Any) -> None:
    try:
        connection.close()
    except FAULTS as fault:
        log.info("mail_connection_lost", reason=type(fault).__name__)


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


def _end(mail: Mail, *, now: datetime, delivery: Delivery) -> None:
    is_sent = delivery.outcome is Outcome.SENT
    # Links in the text open accounts. An address to which nothing was sent is what maintainers ask for.
    ended: dict[str, Any] = {"subject": "", "text": "", "ended_at": now, "is_sent": is_sent}
    ended |= {"recipient": "", "reason": ""} if is_sent else {"reason": delivery.reason}
    is_mine = Mail.objects.filter(pk=mail.pk, ended_at=None).update(**ended)
    if is_mine and delivery.outcome not in {Outcome.SENT, Outcome.REFUSED}:
        log.error("mail_given_up", mail_id=mail.pk, kind=mail.kind, outcome=delivery.outcome.value)
