"""`manage.py set_announcement [TEXT --until MOMENT]`."""

from argparse import ArgumentParser
from typing import Any

from django.utils import timezone

from leaderboard.benchmark import moments, policy
from leaderboard.management.arguments import RefusingCommand


class Command(RefusingCommand):
    """Shows a line on the pages of all splits."""

    help = "Show one line on the pages of all splits until it ends; without a text, remove it."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """TEXT, until."""
        parser.add_argument("text", nargs="?", default="", help="plain text, at most 300 characters")
        parser.add_argument("--until", metavar="MOMENT", help=f"like “{moments.EXAMPLE}”")

    def handle(self, *args: Any, **options: Any) -> None:
        """Show it, or remove it."""
        ends_at = moments.parse(options["until"]) if options["until"] else None
        policy.announce(text=options["text"], ends_at=ends_at, now=timezone.now(), actor=None)
        self.stdout.write("The announcement is shown." if options["text"] else "The announcement is removed.")
