"""`manage.py import_published FILE [--replace]`."""

from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from django.core.management.base import CommandError
from django.utils import timezone

from leaderboard.benchmark import papers, splits
from leaderboard.management.arguments import RefusingCommand


class Command(RefusingCommand):
    """Puts the rows of a paper on the boards."""

    help = "Add the rows of a paper to the boards. Boards as of earlier dates do not change."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """FILE, replace."""
        parser.add_argument("file", help="a document as in docs/maintainers.md")
        parser.add_argument("--replace", action="store_true", help="replace rows that have other content")

    def handle(self, *args: Any, **options: Any) -> None:
        """Import, and say what became of each row."""
        path = Path(options["file"])
        try:
            document = papers.parse(path.read_bytes())
            done = splits.import_published(
                document=document, now=timezone.now(), is_replacing=options["replace"]
            )
        except OSError as error:
            raise CommandError(f"{path} cannot be read: {error.strerror}.") from error
        except papers.BadDocument as refused:
            raise CommandError(f"{path} was refused; nothing was changed.\n{refused}") from refused
        for outcome, names in vars(done).items():
            for name in names:
                self.stdout.write(f"{outcome}: {name}")
