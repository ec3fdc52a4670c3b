"""Logging: one line an event, readable in a terminal, JSON for machines.

Lines about a submission carry `submission_id` and `evaluation_id`, those of one request `request_id`, those
of one task `task_id`. What nobody may read in a log (tokens, passwords in addresses, e-mail addresses, the
keys in links that were mailed) is not logged to begin with; the last step of every line takes out what slips
in with a library's message or a traceback.
"""

import logging
import re
from typing import Any, Final

import structlog
from structlog.typing import Processor

SECRETS: Final = (
    # An API token.
    (re.compile(r"tsttc_[0-9a-f]{8,64}"), "tsttc_[hidden]"),
    # Whatever authorises a request.
    (re.compile(r"(?i)\b(bearer|basic)\s+[\w.~+/=-]+"), r"\1 [hidden]"),
    # The password in a service's URL.
    (re.compile(r"(?<=://)[^/\s@\"']+@"), "[hidden]@"),
    # A link that opens an account or a team, also as the value of another address.
    (
        re.compile(
            r"(?i)((?:/|%2F)(?:accounts(?:/|%2F)(?:confirm-email|password(?:/|%2F)reset(?:/|%2F)key)"
            r"|team(?:/|%2F)join)(?:/|%2F))[^\s\"'?&]+"
        ),
        r"\1[hidden]",
    ),
    # An e-mail address.
    (re.compile(r"[\w.+-]+@[\w-]+(?:\.[\w-]+)+"), "[address hidden]"),
)


def without_secrets(text: str) -> str:
    """The text with everything that looks like a secret or an e-mail address taken out.

    >>> without_secrets("GET /accounts/password/reset/key/4-abc-def/ by ada@example.org")
    'GET /accounts/password/reset/key/[hidden] by [address hidden]'
    >>> without_secrets("Forbidden (CSRF token missing.): /team/join/OTU0bQ-x_y/")
    'Forbidden (CSRF token missing.): /team/join/[hidden]'
    >>> without_secrets("redis://:swordfish@cache:6379/0 refused")
    'redis://[hidden]@cache:6379/0 refused'
    """
    for pattern, stand_in in SECRETS:
        text = pattern.sub(stand_in, text)
    return text


class CleanFormatter(structlog.stdlib.ProcessorFormatter):
    """Writes a line, then takes out what must not be in it."""

    def format(self, record: logging.LogRecord) -> str:
        """The line as it goes out."""
        return without_secrets(super().format(record))


def _shared() -> list[Processor]:
    """What every line gets, our own and the libraries' alike."""
    return [
        structlog.contextvars.merge_contextvars,
        structlog.stdlib.add_log_level,
        structlog.stdlib.add_logger_name,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
    ]


def formatter(*, as_json: bool) -> logging.Formatter:
    """JSON for machines, or columns for people."""
    last: list[Processor]
    if as_json:
        last = [structlog.processors.format_exc_info, structlog.processors.JSONRenderer(default=str)]
    else:
        # The plain traceback: the pretty one prints local variables, and with them what a file contains.
        last = [
            structlog.dev.ConsoleRenderer(colors=False, exception_formatter=structlog.dev.plain_traceback)
        ]
    return CleanFormatter(
        foreign_pre_chain=_shared(),
        processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, *last],
    )


def configure() -> None:
    """Send structlog's events through the standard library's handlers."""
    structlog.configure(
        processors=[
            structlog.stdlib.filter_by_level,
            *_shared(),
            structlog.stdlib.PositionalArgumentsFormatter(),
            structlog.processors.StackInfoRenderer(),
            structlog.stdlib.ProcessorFormatter.wrap_for_formatter,
        ],
        logger_factory=structlog.stdlib.LoggerFactory(),
        wrapper_class=structlog.stdlib.BoundLogger,
    )


def logging_settings(*, as_json: bool, level: str, has_reports: bool = False) -> dict[str, Any]:
    """The value of Django's `LOGGING`: everything to standard error, in one form; faults by mail as well."""
    reports: dict[str, Any] = {
        "class": "leaderboard.mails.fault_reports.FaultReportHandler",
        "formatter": "line",
        "level": "ERROR",
    }
    return {
        "version": 1,
        "disable_existing_loggers": False,
        "formatters": {"line": {"()": "leaderboard.ops.logs.formatter", "as_json": as_json}},
        "handlers": {
            "stderr": {"class": "logging.StreamHandler", "formatter": "line"},
            **({"reports": reports} if has_reports else {}),
        },
        "root": {"handlers": ["stderr", *(["reports"] if has_reports else [])], "level": level},
        "loggers": {
            # Their own handlers would say everything twice.
            "django": {"handlers": [], "level": level, "propagate": True},
            "django.server": {"handlers": [], "level": level, "propagate": True},
            "gunicorn.error": {"handlers": [], "level": level, "propagate": True},
            # The request's and the task's own lines have it all, with their ids.
            "django.request": {"level": "CRITICAL"},
            "celery.worker.strategy": {"level": "WARNING"},
            "celery.app.trace": {"level": "WARNING"},
            # Says at every connection that a broker made of files has no host name.
            "kombu.connection": {"level": "ERROR"},
            # Says at every second request that one waits for a thread.
            "waitress.queue": {"level": "ERROR"},
        },
    }
