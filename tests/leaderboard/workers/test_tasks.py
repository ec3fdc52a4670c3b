"""`leaderboard.tasks`: what a message makes a worker do, and the connection with which it does it."""

import pytest
from celery.fixups.django import DjangoWorkerFixup
from django.db import connection

from leaderboard import tasks
from leaderboard.celery import app

pytestmark = [pytest.mark.slow, pytest.mark.django_db(transaction=True)]


@pytest.mark.parametrize("task", [tasks.nudge, tasks.work_off], ids=["nudge", "work_off"])
def test_a_connection_outlives_the_task_until_it_is_too_old(task: object) -> None:
    """Celery's own part runs around it as in a worker."""
    around = DjangoWorkerFixup(app)

    def run() -> object:
        around.close_database()
        task()  # type: ignore[operator]
        around.close_database()
        return connection.connection

    kept = run()
    assert kept is not None
    assert run() is kept
    connection.close_at = 0.0
    if connection.vendor == "postgresql":  # a database in memory would be gone
        assert run() is not kept
