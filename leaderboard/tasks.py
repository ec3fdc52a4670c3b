"""Celery tasks: each is one call of a verb. A message carries no work, only the news that some is waiting."""

import random

from celery import shared_task
from django.utils import timezone

from leaderboard import backlog, clock, queue, scoring, snapshots, upkeep


@shared_task(name="leaderboard.tasks.nudge")
def nudge(evaluation_id: str) -> None:
    """Decide one waiting evaluation: the most urgent, which need not be the one that the message names."""
    scoring.run_next(rng=random.Random())  # noqa: S311 - jitter, not a secret


@shared_task(name="leaderboard.tasks.sweep")
def sweep() -> None:
    """Take back what dead workers hold and nudge again what waits."""
    queue.sweep(rng=random.Random())  # noqa: S311 - jitter, not a secret


@shared_task(name="leaderboard.tasks.clean")
def clean() -> None:
    """Remove stored files that no submission names, and what has had its time."""
    upkeep.clean(now=clock.database_now())


@shared_task(name="leaderboard.tasks.infer")
def infer(about: str) -> None:
    """Do what waits behind submissions, whatever the message is about."""
    backlog.work_off(now=timezone.now(), rng=random.Random())  # noqa: S311 - jitter, not a secret


@shared_task(name="leaderboard.tasks.redraw")
def redraw(split_id: str) -> None:
    """Draw a split's board for its readers, if nobody has since it changed."""
    snapshots.redraw(split_id=split_id, now=timezone.now())
