"""`manage.py backup DIR`."""

from argparse import ArgumentParser
from typing import Any

from django.core.management.base import BaseCommand, CommandError
from django.db import Error as DatabaseProblem
from django.utils import timezone

from evaluator.counting import counted
from leaderboard.backups import backup, contents


class Command(BaseCommand):
    help = "Back up the whole site into a folder, while it runs; again into the same one: only what is new."

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("dir", metavar="DIR", help="an empty folder, or one that has an earlier backup")

    def handle(self, *args: Any, **options: Any) -> None:
        try:
            made = backup.make(into=options["dir"], now=timezone.now())
        except (contents.NoBackup, OSError, DatabaseProblem) as fault:
            raise CommandError(f"There is no new backup. {fault}") from fault
        self.stdout.write(
            f"Backed up: {counted(len(made.files), 'file')}, {len(made.ground_truth)} of ground "
            f"truth, {counted(len(made.boards), 'board')}; last hash of the audit log {made.audit}"
        )
        if made.missing:
            raise CommandError(
                "The backup is there, but the site lacks these files, so the backup does too "
                f"({len(made.missing):,}):\n{contents.listed(made.missing)}"
            )
