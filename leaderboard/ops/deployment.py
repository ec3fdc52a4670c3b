"""Checks of `check --deploy`: variables, and the services that they name, without addresses or passwords."""

import os
import smtplib
import ssl
from collections.abc import Iterator
from contextlib import suppress
from typing import Any, Final
from urllib.parse import urlsplit

from django.conf import settings
from django.core.checks import CheckMessage, Error
from django.core.checks import Warning as Caution
from django.core.files.storage import storages
from django.core.mail import get_connection
from django.http.request import validate_host

from leaderboard.ops import environment, health

_MAIL_FAULTS: Final = (OSError, smtplib.SMTPException)
_BROKERS: Final = ("redis://", "rediss://", "redis+socket://", "amqp://", "amqps://")


def check_variables(app_configs: object = None, **kwargs: Any) -> list[CheckMessage]:
    """Report faults of the variables."""
    messages: list[CheckMessage] = [
        Caution(sentence, id="leaderboard.W002") for sentence in environment.misspelt(os.environ)
    ]
    if not environment.PRODUCTION:
        return messages
    messages += [Error(sentence, id="leaderboard.E002") for sentence in _addresses()]
    if environment.PROCESS == "web" and not settings.SENDS_MAIL:
        message = "TSTTC_EMAIL_URL is not set: mails go to standard output, and no address is confirmed."
        messages.append(Caution(message, id="leaderboard.W003"))
    if settings.SENDS_MAIL and settings.DEFAULT_FROM_EMAIL.endswith("@localhost"):
        message = (
            "TSTTC_FROM_EMAIL is not set: mails come from leaderboard@localhost, which mail servers refuse."
        )
        messages.append(Caution(message, id="leaderboard.W004"))
    return messages


def check_services(app_configs: object = None, **kwargs: Any) -> list[CheckMessage]:
    """Report the services that do not answer within some seconds."""
    if not environment.PRODUCTION:
        return []
    faults = []
    if not health.database().is_ok:
        faults.append("The database of TSTTC_DATABASE_URL does not answer, or does not know the account.")
    if environment.PROCESS in {"web", "worker", "maintainer"}:
        if settings.CELERY_BROKER_URL.startswith(_BROKERS) and not health.broker().is_ok:
            faults.append("The broker of TSTTC_BROKER_URL does not answer.")
        try:
            storages["files"].exists("manifests/none.csv")
        except Exception as fault:  # noqa: BLE001 - whatever the store of somebody else raises
            faults.append(f"The file store does not answer: {type(fault).__name__}.")
        if not settings.FILES_URL and not _can_be_written(str(settings.FILES_DIR)):
            faults.append(f"TSTTC_FILES_DIR is {settings.FILES_DIR}, which this account cannot write to.")
    if settings.SENDS_MAIL:
        faults += _mail_server()
    return [Error(sentence, id="leaderboard.E003") for sentence in faults]


def _mail_server() -> Iterator[str]:
    """Connect to the mail server and sign in; send nothing."""
    connection = get_connection()
    try:
        connection.open()
    except _MAIL_FAULTS as fault:
        yield (
            f"The mail server of TSTTC_EMAIL_URL does not let the site in ({_reason(fault)}). "
            "Without it, no code for signing in arrives."
        )
    finally:
        with suppress(*_MAIL_FAULTS):
            connection.close()


def _reason(fault: Exception) -> str:
    """Say what a mail server answered, without address and password."""
    if isinstance(fault, smtplib.SMTPAuthenticationError):
        return f"it refuses user or password, code {fault.smtp_code}"
    if isinstance(fault, smtplib.SMTPNotSupportedError):
        return "it offers no sign-in or no encryption; does the port fit smtp+tls or smtp+ssl?"
    if isinstance(fault, smtplib.SMTPResponseException):
        return f"it answers with code {fault.smtp_code}"
    if isinstance(fault, ssl.SSLError):
        return "the encrypted connection fails; does the port fit smtp+tls or smtp+ssl?"
    return getattr(fault, "strerror", None) or type(fault).__name__


def _addresses() -> Iterator[str]:
    site = urlsplit(settings.SITE_URL)
    if site.scheme not in {"http", "https"} or not site.hostname or site.path:
        yield f"TSTTC_SITE_URL is {settings.SITE_URL!r}; expected an address such as https://board.example.org."
    elif site.scheme == "http":
        yield (
            f"TSTTC_SITE_URL is {settings.SITE_URL!r}; expected https, since browsers send the cookie of a "
            "session over https only."
        )
    elif not validate_host(site.hostname, settings.ALLOWED_HOSTS):
        yield f"TSTTC_ALLOWED_HOSTS lacks {site.hostname}, the host of TSTTC_SITE_URL."
    if environment.PROCESS in {"web", "worker", "maintainer"} and not settings.CELERY_BROKER_URL.startswith(
        _BROKERS
    ):
        yield "TSTTC_BROKER_URL is not understood; expected redis://user:password@host:6379/0."


def _can_be_written(folder: str) -> bool:
    # Of a folder that is not there, the first existing one above it counts.
    while folder and not os.path.exists(folder):  # noqa: PTH110 - a name that may be of nothing
        folder = os.path.dirname(folder)  # noqa: PTH120 - the same
    return os.path.isdir(folder) and os.access(folder, os.W_OK)  # noqa: PTH112 - the same
