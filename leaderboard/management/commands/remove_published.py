"""`manage.py remove_published SPLIT SLUG --reason TEXT`."""

from argparse import ArgumentParser
from typing import Any

from django.utils import timezone

from leaderboard.benchmark import splits
from leaderboard.management.arguments import RefusingCommand


class Command(RefusingCommand):
    """Takes a row that is quoted from a paper off a board."""

    help = "Remove a row of a paper from a board. Boards as of earlier dates do not change."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """SPLIT, SLUG, reason."""
        parser.add_argument("split", metavar="SPLIT")
        parser.add_argument("slug", metavar="SLUG", help="as in the document that was imported")
        parser.add_argument("--reason", required=True, metavar="TEXT", help="one sentence for the audit log")

    def handle(self, *args: Any, **options: Any) -> None:
        """Remove it, and say so."""
        splits.remove_published(
            split_name=options["split"], slug=options["slug"], reason=options["reason"], now=timezone.now()
        )
        self.stdout.write(f"removed: {options['split']}/{options['slug']}")
