"""`manage.py backup DIR`."""

from argparse import ArgumentParser
from typing import Any

from django.core.exceptions import ImproperlyConfigured
from django.core.management.base import BaseCommand, CommandError
from django.db import Error as DatabaseProblem
from django.utils import timezone

from evaluator.counting import counted
from leaderboard.backups import backup, contents
from leaderboard.submissions import receipts


class Command(BaseCommand):
    help = "Back up the whole site into a folder, while it runs; again into the same one: only what is new."

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument(
            "dir", metavar="DIR", help="a folder of its own, which may have an earlier backup"
        )

    def handle(self, *args: Any, **options: Any) -> None:
        try:
            made = backup.make(into=options["dir"], now=timezone.now())
        except (contents.NoBackup, OSError, DatabaseProblem, ImproperlyConfigured) as fault:
            raise CommandError(f"There is no new backup. {fault}") from fault
        self.stdout.write(
            f"Backed up: {counted(len(made.files), 'file')}, {len(made.ground_truth)} of ground "
            f"truth, {counted(len(made.boards), 'board')}; last hash of the audit log {made.audit}"
        )
        if not made.keys["keys"]:
            self.stderr.write(
                f"{receipts.PUBLIC_KEY} is not set, so the backup has no public key of receipts. "
                "`check --deploy` of the web process prints its value."
            )
        if made.known_lost:
            self.stdout.write(
                f"{counted(len(made.known_lost), 'file')} known to be lost for good:\n"
                + contents.listed_faults(made.known_lost)
            )
        if made.faults:
            raise CommandError(
                "The backup is there, with the whole database, but these files are lost, damaged or "
                f"unreadable ({len(made.faults):,}):\n{contents.listed_faults(made.faults)}\n"
                "Copy good ones back, or say with acknowledge_loss that they are lost for good."
            )
