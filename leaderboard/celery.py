"""The Celery application; all its settings live in `leaderboard/settings.py` under `CELERY_`."""

import os
import random

from celery import Celery
from celery.signals import setup_logging, worker_process_init, worker_process_shutdown
from django_structlog.celery.steps import DjangoStructLogInitStep
from kombu.transport import TRANSPORT_ALIASES

os.environ.setdefault("DJANGO_SETTINGS_MODULE", "leaderboard.settings")

TRANSPORT_ALIASES["filesystem"] = "leaderboard.folder_broker:Transport"

app = Celery("leaderboard")
app.config_from_object("django.conf:settings", namespace="CELERY")
app.autodiscover_tasks()
# Lines of a task carry its id, and the id of the request that sent it.
app.steps["worker"].add(DjangoStructLogInitStep)


@setup_logging.connect  # that somebody listens is what keeps Celery from installing its own handlers
def keep_our_logging(**_: object) -> None:
    """Leave logging as `leaderboard/logs.py` set it up."""


@worker_process_init.connect  # Celery has no other door into the processes that run tasks
def look_for_work_unasked(**_: object) -> None:
    """Start this process's poller, so that queued work is found with no broker at all."""
    from leaderboard.queue import Poller  # noqa: PLC0415 - the app registry is ready only now

    poller = Poller(rng=random.Random())  # noqa: S311 - jitter, not a secret
    poller.start()

    @worker_process_shutdown.connect(weak=False)
    def finish_what_is_in_hand(**_: object) -> None:
        """Let the poller finish, as Celery lets a task; else its evaluation waits for its lease to end."""
        poller.stop(patience_s=app.conf.worker_soft_shutdown_timeout)
