"""`manage.py open_edition SPLIT --truth PATH`."""

import sys
import time
from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from django.conf import settings
from django.core.management.base import CommandError
from django.urls import reverse
from django.utils import timezone

from evaluator.counting import counted
from evaluator.metrics.protocol import PROTOCOLS
from evaluator.tables.formats import csv_lines
from leaderboard.editions import corrections, history, label_changes
from leaderboard.management.arguments import RefusingCommand
from leaderboard.models import Edition, Split
from leaderboard.storage import files


class Command(RefusingCommand):
    help = (
        "Open an edition with corrected ground truth and re-score all submissions that are not withdrawn. "
        "Nothing public changes; after an interruption run the command again."
    )

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("split")
        parser.add_argument("--truth", type=Path, required=True, help="CSV file or annotation folder")
        parser.add_argument("--protocol", choices=sorted(PROTOCOLS), help="default: unchanged")
        parser.add_argument(
            "--dry-run", action="store_true", help="only say what --truth would change; keep nothing"
        )
        parser.add_argument(
            "--diff",
            type=Path,
            metavar="FILE.csv",
            help="with --dry-run: a row for each recording that changes",
        )
        parser.add_argument("--wait", action="store_true", help="show progress until all are decided")

    def handle(self, *args: Any, **options: Any) -> None:
        if options["dry_run"] or options["diff"]:
            self._look(options)
            return
        edition = corrections.open_edition(
            split_name=options["split"],
            path=options["truth"],
            protocol=options["protocol"],
            now=timezone.now(),
            actor=None,
        )
        published = (
            Split.objects.select_related("current_edition__ground_truth")
            .get(pk=edition.split_id)
            .current_edition
        )
        assert published is not None  # noqa: S101 - for the type checker: a correction was opened beside it
        change = history.change_of_truth(published.ground_truth, edition.ground_truth)
        self.stdout.write(
            f"{edition}: ground truth {edition.ground_truth_id}, protocol {edition.protocol}, "
            f"decimals {edition.decimals}, unit {edition.unit_noun}; against edition {published.number}: "
            f"{counts(change)}."
        )
        if options["wait"]:
            self._follow(edition)
        self.stdout.write(line(corrections.progress(edition)))
        # A demo has the port that its own command was given.
        site = settings.SITE_URL if settings.PRODUCTION else "your demo, "
        path = reverse("maintain_edition", args=[edition.split_id, edition.number])
        self.stdout.write(f"Compare and publish it at {site}{path}")

    def _look(self, options: dict[str, Any]) -> None:
        if not options["dry_run"]:
            raise CommandError("--diff needs --dry-run.")
        changes = label_changes.load(split_name=options["split"], path=options["truth"])
        counts, rows = changes.counts, changes.recordings
        self.stdout.write(
            f"Against {changes.edition}: {counted(counts.n_added, 'sequence')} added, "
            f"{counts.n_removed} removed, {counts.n_changed} changed; {counts.n_renumbered} with "
            f"another anno_id; in {counted(len(rows), 'recording')}. Nothing was kept."
        )
        for row in rows[:10]:
            self.stdout.write(
                f"  {row['recording']}: {row['n_added']} added, {row['n_removed']} removed, "
                f"{row['n_changed']} changed by up to {row['largest_change_s']:.3f} s"
            )
        if options["diff"]:
            lines = csv_lines(rows, columns=label_changes.COLUMNS)
            try:
                # It has values of the ground truth: for its owner only.
                with files.replacing(options["diff"]) as unfinished:
                    unfinished.write_text("".join(lines), encoding="utf-8", newline="")
            except OSError as fault:
                raise CommandError(f"{options['diff']} cannot be written: {fault.strerror}") from fault

    def _follow(self, edition: Edition) -> None:
        # One line that renews itself on a terminal, one line a change elsewhere.
        last = ""
        while (progress := corrections.progress(edition)).n_waiting:
            text = line(progress)
            if text != last:
                self.stdout.write(text, ending="\r" if sys.stdout.isatty() else "\n")
                last = text
            # The work is done by other processes; only the database knows how far they are.
            time.sleep(1)


def counts(change: history.TruthChange | None) -> str:
    """Word the differences between two ground truths."""
    if change is None:
        return "different ground truth, not compared yet"
    added = counted(change.n_added, "sequence")
    text = f"{added} added, {change.n_removed} removed, {change.n_changed} changed"
    if change.n_renumbered is None:
        return text
    return f"{text}; {counted(change.n_renumbered, 'sequence has', 'sequences have')} another anno_id"


def line(progress: corrections.RescoringProgress) -> str:
    rate = f", {progress.rate_per_s:.1f}/s" if progress.rate_per_s else ""
    left = f", {progress.left_s:.0f} s left" if progress.left_s is not None else ""
    return (
        f"{progress.percent:3d}%  {progress.n_done} of {progress.n_total}: {progress.n_scored} scored, "
        f"{progress.n_rejected} rejected, {progress.n_failed} with a system error{rate}{left}"
    )
