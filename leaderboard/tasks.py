"""Celery tasks: each calls one function. A message carries no work, only the news that some is waiting."""

import random

from celery import shared_task
from django.db import close_old_connections
from django.utils import timezone

from leaderboard.queue import worker

# `queue` is what a worker runs by itself. Celery only logs an error of the signal that starts it, and goes on
# without; an error here keeps the worker from starting.
from leaderboard.upkeep import backlog


@shared_task(name="leaderboard.tasks.nudge")
def nudge() -> None:
    """Decide the most urgent waiting evaluation."""
    close_old_connections()
    worker.run_next(rng=random.Random())  # noqa: S311 - jitter, not a secret


@shared_task(name="leaderboard.tasks.work_off")
def work_off() -> None:
    close_old_connections()
    backlog.work_off(now=timezone.now(), rng=random.Random())  # noqa: S311 - jitter, not a secret
