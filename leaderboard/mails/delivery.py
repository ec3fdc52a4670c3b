"""One try to deliver a mail, and what the mail server says of it.

A server refuses a mail for good (5xx), puts it off (4xx), or there is no connection. The last concerns other
mails, too. So may a refusal that does not blame the mailbox or the text, such as "Relay access denied".
"""

import re
import smtplib
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

import structlog
from django.core.mail import EmailMessage

log = structlog.get_logger(__name__)

# What a mail server that is away, or does not let this site in, raises.
FAULTS: Final = (OSError, smtplib.SMTPException)
MAX_REASON: Final = 200
# The server ends the connection, or wants a log-in: the mail is not at fault.
_CONNECTION_CODES: Final = frozenset({421, 454, 530, 534, 535, 538})
_FIRST_PERMANENT: Final = 500
_TOO_LARGE: Final = 552
# Enhanced codes (RFC 3463) that blame the mailbox, the address or the text of one mail. 5.1.7 and 5.1.8
# blame the sender, 5.7 the rights of whoever sends; without such a code, a server may mean anything.
_OF_ONE_MAIL: Final = re.compile(r"[45]\.(1\.[1-6]|1\.9|1\.10|2\.\d+|3\.4|6\.\d+)\b", re.ASCII)


class Outcome(StrEnum):
    SENT = "sent"
    REFUSED = "refused"
    REFUSED_PERHAPS_ALL = "refused, perhaps as every mail is"
    PUT_OFF = "put off"
    NO_CONNECTION = "no connection"


@dataclass(frozen=True)
class Delivery:
    """What came of one try. `reason` is what the server said; it may name the recipient."""

    outcome: Outcome
    reason: str = ""


def deliver(message: EmailMessage, *, connection: Any = None) -> Delivery:
    """Send a mail to one person, by an open connection if there is one. Never fails."""
    message.connection = connection
    delivery = _tried(message)
    if delivery.outcome is not Outcome.SENT:
        # The server's own words name the recipient; logs name nobody.
        log.warning("mail_not_sent", outcome=delivery.outcome.value, code=delivery.reason[:3])
    return delivery


def no_connection(fault: Exception) -> Delivery:
    return Delivery(Outcome.NO_CONNECTION, _one_line(f"{type(fault).__name__}: {fault}"))


def _tried(message: EmailMessage) -> Delivery:
    try:
        n_sent = message.send()
    except smtplib.SMTPRecipientsRefused as fault:
        [(code, answer)] = list(fault.recipients.values())[:1]
        return _answered(code, answer)
    except smtplib.SMTPDataError as fault:
        return _answered(fault.smtp_code, fault.smtp_error)
    except smtplib.SMTPSenderRefused as fault:
        # The sender is the site, so no other mail would be taken either; but one mail may be too large.
        is_too_large = fault.smtp_code == _TOO_LARGE
        delivery = _answered(fault.smtp_code, fault.smtp_error)
        return delivery if is_too_large else Delivery(Outcome.NO_CONNECTION, delivery.reason)
    except FAULTS as fault:
        return no_connection(fault)
    except ValueError as fault:
        # An address or a subject that no mail can have.
        return Delivery(Outcome.REFUSED, _one_line(f"The address cannot be written in a mail: {fault}"))
    return Delivery(Outcome.SENT) if n_sent else Delivery(Outcome.REFUSED, "The mail has no recipient.")


def _answered(code: int, answer: bytes | str) -> Delivery:
    reason = f"{code} {_text(answer)}"[:MAX_REASON]
    if code in _CONNECTION_CODES:
        return Delivery(Outcome.NO_CONNECTION, reason)
    if code < _FIRST_PERMANENT:
        return Delivery(Outcome.PUT_OFF, reason)
    is_of_one = code == _TOO_LARGE or blames_one_mail(reason)
    return Delivery(Outcome.REFUSED if is_of_one else Outcome.REFUSED_PERHAPS_ALL, reason)


def blames_one_mail(reason: str) -> bool:
    """Tell whether a server's answer is about this mail alone, so that others may be taken.

    >>> blames_one_mail("550 5.1.1 No such user"), blames_one_mail("554 5.7.1 Relay access denied")
    (True, False)
    """
    _, _, text = reason.partition(" ")
    return _OF_ONE_MAIL.match(text) is not None


def _text(answer: bytes | str) -> str:
    return _one_line(answer.decode("utf-8", "replace") if isinstance(answer, bytes) else str(answer))


def _one_line(text: str) -> str:
    printable = "".join(letter if letter.isprintable() else " " for letter in text)
    return " ".join(printable.split())[:MAX_REASON]
