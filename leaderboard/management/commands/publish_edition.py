"""`manage.py publish_edition SPLIT NUMBER --reason …` and the way back with `--roll-back`."""

from argparse import ArgumentParser
from typing import Any

from django.core.management.base import BaseCommand, CommandError
from django.utils import timezone

from leaderboard import rescoring
from leaderboard.models import Edition, Publication, Split


class Command(BaseCommand):
    """Makes an edition the board."""

    help = "Make an edition the board of its split, or with --roll-back return to the one before."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """SPLIT, NUMBER, reason."""
        parser.add_argument("split")
        parser.add_argument(
            "number", type=int, help="the edition to publish; with --roll-back the one to leave"
        )
        parser.add_argument("--reason", required=True, help="a sentence for the public changelog")
        parser.add_argument("--roll-back", action="store_true")
        parser.add_argument(
            "--leave-out",
            action="store_true",
            help="publish although some are unfinished, or scored on the board and rejected in this edition",
        )

    def handle(self, *args: Any, **options: Any) -> None:
        """Publish or roll back, and say what is the board now."""
        try:
            publication = self._roll_back(options) if options["roll_back"] else self._publish(options)
        except rescoring.Refused as refused:
            raise CommandError(str(refused)) from refused
        self.stdout.write(f"The board of {publication.split_id} is {publication.edition}.")

    def _publish(self, options: dict[str, Any]) -> Publication:
        edition = Edition.objects.filter(split=options["split"], number=options["number"]).first()
        if edition is None:
            raise CommandError(f"There is no edition {options['number']} of {options['split']!r}.")
        published = Split.objects.get(pk=edition.split_id).published_edition
        return rescoring.publish(
            edition=edition,
            reason=options["reason"],
            now=timezone.now(),
            actor=None,
            replaces=published.number if published else None,
            leave_out=options["leave_out"],
        )

    def _roll_back(self, options: dict[str, Any]) -> Publication:
        if not Split.objects.filter(pk=options["split"]).exists():
            raise CommandError(f"There is no split {options['split']!r}.")
        return rescoring.roll_back(
            split_name=options["split"],
            reason=options["reason"],
            now=timezone.now(),
            actor=None,
            replaces=options["number"],
        )
