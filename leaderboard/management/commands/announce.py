"""`manage.py announce SPLIT --subject TEXT FILE`."""

import sys
from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from django.core.management.base import CommandError
from django.utils import timezone

from evaluator.counting import counted
from leaderboard.mails import announcements
from leaderboard.management.arguments import RefusingCommand, split_of


class Command(RefusingCommand):
    """Mails everybody whose team has sent a file to a split."""

    help = "Mail an announcement to the teams of a split; people who switched announcements off get none."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """To whom, and what."""
        parser.add_argument("split", metavar="SPLIT")
        parser.add_argument("file", metavar="FILE", help="the text of the mail; - for standard input")
        parser.add_argument("--subject", required=True, metavar="TEXT")

    def handle(self, *args: Any, **options: Any) -> None:
        """Queue it, once for each person whatever happens, and say for how many."""
        split = split_of(options)
        try:
            text = sys.stdin.read() if options["file"] == "-" else Path(options["file"]).read_text("utf-8")
        except (OSError, UnicodeDecodeError) as fault:
            raise CommandError(f"{options['file']} cannot be read as text: {fault}") from fault
        announcement = announcements.written(split=split, subject=options["subject"], text=text)
        n_people = announcements.announce(announcement, now=timezone.now(), actor=None)
        people = counted(n_people, "person", "people")
        self.stdout.write(f"Queued for {people}. The same text again reaches only those who have not got it.")
