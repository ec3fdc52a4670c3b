"""`manage.py check_units SPLIT NUMBER`."""

from argparse import ArgumentParser
from typing import Any

from django.core.management.base import CommandError

from evaluator.counting import counted
from evaluator.units import MIN_DAYS, RECORDING
from leaderboard.management.arguments import RefusingCommand
from leaderboard.models import Edition
from leaderboard.statistics import unit_checks


class Command(RefusingCommand):
    help = "Say how alike recordings of one day are in an edition, and by how much that widens its intervals."

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("split")
        parser.add_argument("number", type=int)

    def handle(self, *args: Any, **options: Any) -> None:
        edition = Edition.objects.filter(split=options["split"], number=options["number"]).first()
        if edition is None:
            raise CommandError(f"There is no edition {options['number']} of {options['split']!r}.")
        try:
            groups = unit_checks.groups_of(edition)
            rows = list(unit_checks.checks(edition, groups))
        except OSError as fault:
            raise CommandError(f"The values of {edition} are not here: {fault}") from fault
        n_recordings = counted(edition.ground_truth.n_recordings, "recording")
        self.stdout.write(f"{edition}: {n_recordings} in {groups}; its unit is the {edition.unit_noun}.")
        if edition.unit == RECORDING and len(groups) < MIN_DAYS:
            self.stdout.write(
                f"With fewer than {MIN_DAYS} days the recording stays the unit; a column unit of the ground "
                "truth can name another one."
            )
        self.stdout.write(f"SE factor  correlation       p  overall {edition.rules.primary.symbol} of")
        for what, check in rows:
            numbers = (
                f"{check.se_factor:9.2f}  {check.correlation:11.3f}  {check.p:6.4f}"
                if check
                else f"{'–':>9}  {'–':>11}  {'–':>6}"
            )
            self.stdout.write(f"{numbers}  {what}")
        if not rows:
            self.stdout.write("No public method has a score in this edition yet.")
