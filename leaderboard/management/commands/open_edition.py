"""`manage.py open_edition SPLIT`."""

import sys
import time
from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from django.core.management.base import BaseCommand, CommandError
from django.utils import timezone

from evaluator import Rejected
from evaluator.protocol import PROTOCOLS
from leaderboard import editions, ground_truth, rescoring
from leaderboard.models import Edition, Split


class Command(BaseCommand):
    """Opens an edition beside the published one."""

    help = (
        "Open an edition with corrected ground truth or another protocol and re-score every "
        "standing submission for it. Nothing public changes; run it again to go on after an interruption."
    )

    def add_arguments(self, parser: ArgumentParser) -> None:
        """SPLIT, what is new, and whether to wait."""
        parser.add_argument("split")
        parser.add_argument("--truth", type=Path, help="CSV file or annotation folder; default: unchanged")
        parser.add_argument("--protocol", choices=sorted(PROTOCOLS), help="default: unchanged")
        parser.add_argument(
            "--decimals",
            type=int,
            choices=[1, 2],
            help="with how many decimals it publishes; default: as the split says now",
        )
        parser.add_argument("--wait", action="store_true", help="show progress until all are decided")

    def handle(self, *args: Any, **options: Any) -> None:
        """Open, and follow the progress if asked."""
        try:
            edition = rescoring.open_edition(
                split_name=options["split"],
                path=options["truth"],
                protocol=options["protocol"],
                decimals=options["decimals"],
                now=timezone.now(),
                actor=None,
            )
        except Rejected as rejected:
            raise CommandError(
                f"{options['truth']} was refused; nothing was changed.\n{rejected}"
            ) from rejected
        except (rescoring.Refused, ground_truth.Refused) as refused:
            raise CommandError(str(refused)) from refused
        published = (
            Split.objects.select_related("published_edition__ground_truth")
            .get(pk=edition.split_id)
            .published_edition
        )
        assert published is not None  # noqa: S101 - for the type checker: a correction was opened beside it
        self.stdout.write(
            f"{edition}: ground truth {edition.ground_truth_id}, protocol {edition.protocol}, "
            f"decimals {edition.decimals}; "
            f"against edition {published.number}: {counts(editions.truth_change(published, edition))}."
        )
        if options["wait"]:
            self._follow(edition)
        self.stdout.write(line(rescoring.progress(edition)))
        self.stdout.write(
            f"Look before you publish: manage.py preview_edition {edition.split_id} {edition.number}"
        )

    def _follow(self, edition: Edition) -> None:
        """One line that renews itself on a terminal, one line a change elsewhere."""
        last = ""
        while (progress := rescoring.progress(edition)).n_waiting:
            text = line(progress)
            if text != last:
                self.stdout.write(text, ending="\r" if sys.stdout.isatty() else "\n")
                last = text
            # The work is done by other processes; only the database knows how far they are.
            time.sleep(1)


def counts(change: editions.TruthChange | None) -> str:
    """By how much one ground truth differs from another, in words."""
    if change is None:
        return "another ground truth, not compared with this one yet"
    said = f"{change.n_added} sequences added, {change.n_removed} removed, {change.n_changed} changed"
    if change.n_renumbered is None:
        return said
    have = "sequence has" if change.n_renumbered == 1 else "sequences have"
    return f"{said}; {change.n_renumbered} {have} another anno_id"


def line(progress: rescoring.Progress) -> str:
    """The progress in one line."""
    rate = f", {progress.rate_per_s:.1f}/s" if progress.rate_per_s else ""
    left = f", {progress.left_s:.0f} s left" if progress.left_s is not None else ""
    return (
        f"{progress.percent:3d} %  {progress.n_done} of {progress.n_total}: {progress.n_scored} scored, "
        f"{progress.n_rejected} rejected, {progress.n_failed} failed by our fault{rate}{left}"
    )
