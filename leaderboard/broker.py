"""The broker: makes things fast, and may be absent. A message is only the news that something waits."""

import uuid

import structlog
from celery import current_app
from kombu.exceptions import OperationalError

log = structlog.get_logger(__name__)


def nudge(evaluation_id: uuid.UUID) -> bool:
    """Tell the workers that something waits; False if the broker did not take it.

    A lost nudge costs seconds: workers also look by themselves.
    """
    try:
        current_app.send_task("leaderboard.tasks.nudge", args=[str(evaluation_id)], ignore_result=True)
    except (OperationalError, OSError) as fault:
        log.warning("nudge_not_sent", evaluation_id=str(evaluation_id), reason=str(fault)[:200])
        return False
    return True
