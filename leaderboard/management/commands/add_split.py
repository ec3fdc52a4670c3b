"""`manage.py add_split NAME --title TITLE (--hidden | --open | --same-truth-as SPLIT) …`."""

from argparse import ArgumentParser
from dataclasses import replace
from typing import Any

from django.utils import timezone

from leaderboard.benchmark.policy import first_policy
from leaderboard.editions import new_splits
from leaderboard.management.arguments import RefusingCommand, add_to, given
from leaderboard.models import Split
from leaderboard.models.benchmark import Listing


class Command(RefusingCommand):
    """Makes a split, or a challenge on the ground truth of another one."""

    help = "Add a split, or a challenge that shares the ground truth of another split."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """NAME, where its ground truth comes from, and its policy."""
        parser.add_argument("name", help="small letters, digits, hyphens; it stands in addresses and stays")
        truth = parser.add_mutually_exclusive_group(required=True)
        truth.add_argument("--hidden", action="store_true", help="its ground truth is hidden")
        truth.add_argument("--open", action="store_true", help="its ground truth is open")
        truth.add_argument("--same-truth-as", default="", metavar="SPLIT", help="it shares that of SPLIT")
        add_to(parser)

    def handle(self, *args: Any, **options: Any) -> None:
        """Make it, and say what comes next."""
        is_open = options["open"] or not _is_hidden(options["same_truth_as"])
        policy = replace(first_policy(is_hidden=not is_open), **given(options))
        split = new_splits.add_split(
            name=options["name"],
            policy=policy,
            is_hidden=None if options["same_truth_as"] else options["hidden"],
            same_truth_as=options["same_truth_as"],
            now=timezone.now(),
            actor=None,
        )
        self.stdout.write(f"The split {split.pk} is added.")
        if split.published_edition is None:
            self.stdout.write(f"Import its ground truth: manage.py import_truth {split.pk} PATH")
        if split.listing == Listing.OFF:
            self.stdout.write(f"It is on no page until: manage.py change_split {split.pk} --listing listed")


def _is_hidden(name: str) -> bool:
    """Whether the values of the split are hidden; of none or an unknown one, as if they were."""
    return not Split.objects.filter(pk=name, is_hidden=False).exists()
