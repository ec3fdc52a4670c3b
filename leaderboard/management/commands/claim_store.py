"""`manage.py claim_store`."""

from argparse import ArgumentParser
from typing import Any

from django.core.management.base import CommandError

from leaderboard.errors.refusals import clean_text
from leaderboard.management.arguments import RefusingCommand
from leaderboard.storage import ownership

MAX_REASON = 500


class Command(RefusingCommand):
    help = (
        "Make the file store this site's, so that unused files are removed from it again: after a restore, "
        "once no other site uses the store."
    )

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("--reason", metavar="TEXT", required=True, help="for the audit log")

    def handle(self, *args: Any, **options: Any) -> None:
        try:
            before = ownership.claim(reason=clean_text("reason", options["reason"], limit=MAX_REASON))
        except OSError as fault:
            raise CommandError(f"Nothing was changed. {fault}") from fault
        self.stdout.write(
            f"The file store belongs to this site now, and no more to {before}."
            if before
            else "The file store belongs to this site already."
        )
