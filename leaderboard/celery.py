"""The Celery application; all its settings live in `leaderboard/settings.py` under `CELERY_`."""

import os
import random

from celery import Celery
from celery.signals import (
    setup_logging,
    worker_init,
    worker_process_init,
    worker_process_shutdown,
    worker_shutdown,
)
from django_structlog.celery.steps import DjangoStructLogInitStep

from evaluator.limits import keep_memory_private

os.environ.setdefault("DJANGO_SETTINGS_MODULE", "leaderboard.settings")

app = Celery("leaderboard")
app.config_from_object("django.conf:settings", namespace="CELERY")
app.autodiscover_tasks()
# Lines of a task carry its id, and the id of the request that sent it.
app.steps["worker"].add(DjangoStructLogInitStep)


@setup_logging.connect  # that somebody listens is what keeps Celery from installing its own handlers
def use_own_logging(**_: object) -> None:
    """Leave logging as `leaderboard/ops/logs.py` set it up."""


@worker_init.connect  # before the processes that run tasks are forked, which inherit it
def keep_secrets_from_readers(**_: object) -> None:
    keep_memory_private()


@worker_process_init.connect  # Celery has no other door into the processes that run tasks
def start_poller(**_: object) -> None:
    """Start this process's pollers, which find queued work without a broker."""
    from leaderboard.upkeep.pollers import start_pollers, stop_pollers  # noqa: PLC0415 - needs the apps

    pollers = start_pollers(rng=random.Random())  # noqa: S311 - jitter, not a secret

    # The second is said where the worker has no processes but itself, as in the demo.
    @worker_process_shutdown.connect(weak=False)
    @worker_shutdown.connect(weak=False)
    def finish_what_is_in_hand(**_: object) -> None:
        """Let the pollers finish, as Celery lets a task; else an evaluation waits for its lease to end."""
        stop_pollers(pollers, timeout_s=app.conf.worker_soft_shutdown_timeout)
