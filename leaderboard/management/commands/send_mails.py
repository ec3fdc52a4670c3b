"""`manage.py send_mails [--every S]`."""

import signal
import threading
from argparse import ArgumentParser
from typing import Any

from django.core.management.base import BaseCommand
from django.db import Error as DatabaseProblem
from django.db import connections
from django.utils import timezone

from leaderboard.mails import notices, outbox


class Command(BaseCommand):
    help = "Send the mails that wait: once, or with --every S again and again until the process is ended."

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument(
            "--every", metavar="S", type=float, default=0.0, help="seconds between two rounds"
        )

    def handle(self, *args: Any, **options: Any) -> None:
        if not options["every"]:
            self._once()
            self.stdout.write(f"{outbox.waiting():,} mails still wait.")
            return
        stopping = threading.Event()
        signal.signal(signal.SIGTERM, lambda number, frame: stopping.set())
        while not stopping.wait(options["every"]):
            try:
                self._once()
            except DatabaseProblem as fault:
                self.stderr.write(f"The database does not answer: {str(fault)[:200]}")
            finally:
                connections.close_all()

    def _once(self) -> None:
        now = timezone.now()
        notices.queue_due(now=now)
        n_sent = outbox.work_off(now=now)
        if n_sent:
            self.stdout.write(f"Mails sent: {n_sent:,}.")
