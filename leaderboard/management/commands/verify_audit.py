"""`manage.py verify_audit`."""

from argparse import ArgumentParser
from typing import Any

from django.core.management.base import BaseCommand, CommandError

from leaderboard import audit


class Command(BaseCommand):
    help = "Check that no audit event was changed, removed or inserted. Store the printed hash elsewhere."

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument(
            "--expect",
            metavar="HASH",
            default="",
            help="the hash printed by an earlier run; must still exist",
        )

    def handle(self, *args: Any, **options: Any) -> None:
        verification = audit.verify(expected_hash=options["expect"])
        if verification.breaks:
            lines = "\n".join(
                f"  event {each.event_id}: {each.what}" if each.event_id else f"  {each.what}"
                for each in verification.breaks
            )
            raise CommandError(f"The audit log of {verification.n_events:,} events is damaged:\n{lines}")
        self.stdout.write(f"audit: {verification.n_events:,} events, unbroken, last hash {verification.tip}")
        rest = verification.unsealed
        if rest.n_events:
            self.stdout.write(f"not sealed yet: {rest.n_events:,}, the oldest for {rest.oldest_age_s:.0f} s")
