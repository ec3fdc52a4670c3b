"""`manage.py archive FOLDER`."""

from argparse import ArgumentParser
from typing import Any

from django.core.management.base import BaseCommand, CommandError
from django.db import Error as DatabaseProblem
from django.utils import timezone

from evaluator import archives
from leaderboard.archive import archive
from leaderboard.backups.contents import NoBackup


class Command(BaseCommand):
    help = "Write the public boards, manifests, receipts and docs into an empty folder, to be kept elsewhere."

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("folder", metavar="FOLDER", help="an empty folder, or a new one")

    def handle(self, *args: Any, **options: Any) -> None:
        try:
            made = archives.check(archive.make(into=options["folder"], now=timezone.now()))
        except (NoBackup, OSError, DatabaseProblem) as fault:
            raise CommandError(f"Nothing was archived. {fault}") from fault
        self.stdout.write(
            f"Archived {made.n_files:,} files, {made.n_receipts:,} receipts. List: {made.digest}"
        )
