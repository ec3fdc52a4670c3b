"""`manage.py import_truth SPLIT PATH`."""

from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from django.utils import timezone

from evaluator.counting import counted
from evaluator.metrics.protocol import DEFAULT_PROTOCOL, PROTOCOLS
from leaderboard.editions import ground_truth
from leaderboard.management.arguments import RefusingCommand


class Command(RefusingCommand):
    help = "Validate a ground truth (CSV, or the toolkit's annotation folder), keep it, and open an edition."

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("split", help="val, test or demo")
        parser.add_argument("path", type=Path, help="a CSV file or a folder of annotation files")
        parser.add_argument(
            "--protocol",
            choices=sorted(PROTOCOLS),
            help=f"default: {ground_truth.OPEN_PROTOCOL}, for a hidden split {DEFAULT_PROTOCOL}",
        )

    def handle(self, *args: Any, **options: Any) -> None:
        edition = ground_truth.import_truth(
            split_name=options["split"],
            path=options["path"],
            protocol=options["protocol"],
            now=timezone.now(),
        )
        truth = edition.ground_truth
        self.stdout.write(
            f"{edition}: {counted(truth.n_sequences, 'sequence')} in "
            f"{counted(truth.n_recordings, 'recording')}, "
            f"ground truth {truth.digest}, protocol {edition.protocol}. "
            f"Intervals and ranks: over {edition.units}."
        )
