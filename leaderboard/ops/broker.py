"""The broker, which may be absent: a message only says that something waits."""

import time
from functools import lru_cache
from typing import Any

import structlog
from celery import current_app
from django.conf import settings
from kombu import Connection
from kombu.exceptions import KombuError

log = structlog.get_logger(__name__)

# Somebody waits for an answer while a nudge is sent, and a lost one costs seconds at most.
FAIL_FAST = {
    "socket_timeout": 1.0,
    "socket_connect_timeout": 1.0,
    "retry_on_timeout": False,
    "max_retries": 0,
}
MAX_CONNECTIONS = 16
REST_S = 5.0


class CircuitBreaker:
    """Skip the broker for `rest_s` after a failure, so that not every request waits for it."""

    def __init__(self, *, rest_s: float) -> None:
        self._rest_s = rest_s
        self._until_s = 0.0

    def begin(self) -> None:
        self._until_s = time.monotonic() + self._rest_s

    def __bool__(self) -> bool:
        return time.monotonic() < self._until_s


_rest = CircuitBreaker(rest_s=REST_S)


def nudge() -> bool:
    """Tell the workers that a submission waits; False if the broker did not take it within two seconds."""
    return _sent("nudge")


def work_off() -> bool:
    """Tell the workers of low-priority work; False if the broker did not take it."""
    return _sent("work_off")


def _sent(task: str) -> bool:
    connections = _connections()
    if _rest or connections is None:
        return False
    try:
        with connections.acquire(block=True, timeout=FAIL_FAST["socket_timeout"]) as connection:
            current_app.send_task(f"leaderboard.tasks.{task}", ignore_result=True, connection=connection)
    except (KombuError, OSError) as fault:
        _rest.begin()
        log.warning("message_not_sent", task=task, reason=str(fault)[:200])
        return False
    return True


@lru_cache(maxsize=1)
def _connections() -> Any:
    # Not Celery's own connections, which wait much longer; none for `memory://`: no other process reads it.
    if settings.CELERY_BROKER_URL == "memory://":
        return None
    connection: Connection = current_app.connection_for_write(transport_options=FAIL_FAST)
    return connection.Pool(MAX_CONNECTIONS)
