"""The broker: makes things fast, and may be absent. A message is only the news that something waits."""

import time
import uuid
from functools import lru_cache
from typing import Any

import structlog
from celery import current_app
from kombu import Connection
from kombu.exceptions import KombuError

log = structlog.get_logger(__name__)

# Somebody waits for an answer while a nudge is sent, and a lost one costs seconds at most.
IMPATIENT = {
    "socket_timeout": 1.0,
    "socket_connect_timeout": 1.0,
    "retry_on_timeout": False,
    "max_retries": 0,
}
MAX_CONNECTIONS = 16
REST_S = 5.0


class Rest:
    """After a failure the broker is left alone for a while, or everybody would wait for it in turn."""

    def __init__(self, *, rest_s: float) -> None:
        self._rest_s = rest_s
        self._until_s = 0.0

    def begin(self) -> None:
        """It has just failed."""
        self._until_s = time.monotonic() + self._rest_s

    def __bool__(self) -> bool:
        """Whether it is to be left alone now."""
        return time.monotonic() < self._until_s


_rest = Rest(rest_s=REST_S)


def nudge(evaluation_id: uuid.UUID) -> bool:
    """Tell the workers that something waits; False if the broker did not take it.

    A lost nudge costs seconds: workers also look by themselves. It takes about two seconds at most, and none
    right after one was lost.
    """
    return _sent("nudge", str(evaluation_id), lost="nudge_not_sent", evaluation_id=str(evaluation_id))


def redraw(split_id: str) -> bool:
    """Tell the workers that a split's board has changed; False if the broker did not take it.

    Lost, it costs the next reader the drawing.
    """
    return _sent("redraw", split_id, lost="redraw_not_sent", split=split_id)


def infer(about: int | str) -> bool:
    """Tell the workers that an edition or split has something to infer; False if it was not taken.

    A lost message costs seconds: workers also look by themselves.
    """
    return _sent("infer", str(about), lost="infer_not_sent", about=str(about))


def _sent(task: str, argument: str, *, lost: str, **facts: str) -> bool:
    if _rest:
        return False
    try:
        with _connections().acquire(block=True, timeout=IMPATIENT["socket_timeout"]) as connection:
            current_app.send_task(
                f"leaderboard.tasks.{task}",
                args=[argument],
                ignore_result=True,
                connection=connection,
            )
    except (KombuError, OSError) as fault:
        _rest.begin()
        log.warning(lost, reason=str(fault)[:200], **facts)
        return False
    return True


@lru_cache(maxsize=1)
def _connections() -> Any:
    """This process's connections to the broker: not Celery's own, which wait much longer."""
    connection: Connection = current_app.connection_for_write(transport_options=IMPATIENT)
    return connection.Pool(MAX_CONNECTIONS)
