"""Logging: one line an event, columns for people or JSON for machines.

Lines carry `submission_id`, `evaluation_id`, `request_id` or `task_id`. Secrets are not logged to begin with;
the last step removes those in messages of libraries and tracebacks.
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
    """Hide everything that looks like a secret or an e-mail address."""
    for pattern, stand_in in SECRETS:
        text = pattern.sub(stand_in, text)
    return text


class CleanFormatter(structlog.stdlib.ProcessorFormatter):
    # Last, so that tracebacks and messages of libraries are cleaned as well.
    def format(self, record: logging.LogRecord) -> str:
        return without_secrets(super().format(record))


def _shared() -> list[Processor]:
    return [
        structlog.contextvars.merge_contextvars,
        structlog.stdlib.add_log_level,
        structlog.stdlib.add_logger_name,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
    ]


def formatter(*, as_json: bool) -> logging.Formatter:
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
    """Return the value of Django's `LOGGING`: everything to standard error, faults by mail as well."""
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
