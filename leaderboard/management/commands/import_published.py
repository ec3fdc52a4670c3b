"""`manage.py import_published FILE [--replace]`."""

import json
from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from django.core.management.base import BaseCommand, CommandError
from django.utils import timezone

from leaderboard import benchmark
from leaderboard.texts import Refused


class Command(BaseCommand):
    """Puts the rows of a paper on the boards."""

    help = "Add the rows of a paper to the boards, from now on. Boards of the past do not change."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """FILE, replace."""
        parser.add_argument("file", help="a document such as those in leaderboard/published/")
        parser.add_argument("--replace", action="store_true", help="replace rows that have other content")

    def handle(self, *args: Any, **options: Any) -> None:
        """Import, and say what became of each row."""
        path = Path(options["file"])
        try:
            document = json.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise CommandError(f"{path} cannot be read: {error.strerror}.") from error
        except ValueError as error:
            raise CommandError(f"{path} is no JSON: {error}.") from error
        try:
            done = benchmark.import_published(
                document=document, now=timezone.now(), is_replacing=options["replace"]
            )
        except Refused as refusal:
            raise CommandError(str(refusal)) from refusal
        for outcome, names in vars(done).items():
            for name in names:
                self.stdout.write(f"{outcome}: {name}")
