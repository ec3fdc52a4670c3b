"""`manage.py publish_edition SPLIT NUMBER --reason …` and the way back with `--roll-back`."""

from argparse import ArgumentParser
from typing import Any

from django.utils import timezone

from leaderboard.editions import corrections
from leaderboard.management.arguments import RefusingCommand, edition_of, split_of
from leaderboard.models import Publication, Split


class Command(RefusingCommand):
    """Makes an edition the board."""

    help = "Publish an edition, or roll back to the previous one with --roll-back."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """SPLIT, NUMBER, reason."""
        parser.add_argument("split")
        parser.add_argument(
            "number", type=int, help="the edition to publish; with --roll-back the edition to roll back"
        )
        parser.add_argument("--reason", required=True, help="a sentence for the public changelog")
        parser.add_argument("--roll-back", action="store_true")
        parser.add_argument(
            "--leave-out",
            action="store_true",
            help="publish although some entries are unfinished or newly rejected",
        )

    def handle(self, *args: Any, **options: Any) -> None:
        """Publish or roll back, and say what is the board now."""
        publication = self._roll_back(options) if options["roll_back"] else self._publish(options)
        self.stdout.write(f"The board of {publication.split_id} is {publication.edition}.")

    def _publish(self, options: dict[str, Any]) -> Publication:
        edition = edition_of(options)
        published = Split.objects.get(pk=edition.split_id).published_edition
        return corrections.publish(
            edition=edition,
            reason=options["reason"],
            now=timezone.now(),
            actor=None,
            replaces=published.number if published else None,
            leave_out=options["leave_out"],
        )

    def _roll_back(self, options: dict[str, Any]) -> Publication:
        return corrections.roll_back(
            split_name=split_of(options).pk,
            reason=options["reason"],
            now=timezone.now(),
            actor=None,
            replaces=options["number"],
        )
