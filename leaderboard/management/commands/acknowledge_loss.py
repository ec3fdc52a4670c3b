"""`manage.py acknowledge_loss NAME…`."""

from argparse import ArgumentParser
from typing import Any

from django.utils import timezone

from evaluator.counting import counted
from leaderboard.backups import contents, losses
from leaderboard.management.arguments import RefusingCommand


class Command(RefusingCommand):
    help = (
        "Note that files are lost for good, so that backups without them are good ones. First look for a "
        "copy: in former backups and on other machines."
    )

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("names", metavar="NAME", nargs="+", help="as `backup` and its list name the file")
        parser.add_argument("--reason", metavar="TEXT", required=True, help="for the audit log")

    def handle(self, *args: Any, **options: Any) -> None:
        faults = losses.acknowledge(options["names"], reason=options["reason"], now=timezone.now())
        self.stdout.write(
            f"{counted(len(faults), 'file')} noted as lost for good:\n{contents.listed_faults(faults)}"
        )
