"""`leaderboard.tasks`: what a message makes a worker do, and the connection with which it does it."""

from collections.abc import Callable

import pytest
from celery.fixups import django as fixups
from django.db import connection

from leaderboard import tasks
from leaderboard.celery import app

pytestmark = [pytest.mark.slow, pytest.mark.django_db(transaction=True)]


@pytest.mark.parametrize("task", [tasks.nudge, tasks.work_off], ids=["nudge", "work_off"])
def test_a_connection_outlives_the_task_until_it_is_too_old(task: Callable[[], None]) -> None:
    """Celery's own part runs around it as in a worker."""
    around = fixups.DjangoWorkerFixup(app)  # type: ignore[attr-defined]  # the stubs are of an older Celery

    def run() -> object:
        around.close_database()
        task()
        around.close_database()
        return connection.connection

    kept = run()
    assert kept is not None
    assert run() is kept
    connection.close_at = 0.0
    if connection.vendor == "postgresql":  # a database in memory would be gone
        assert run() is not kept
