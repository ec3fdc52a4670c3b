"""`manage.py preview_edition SPLIT NUMBER`."""

import json
from argparse import ArgumentParser
from typing import Any

from evaluator.counting import counted
from evaluator.tables.formats import csv_lines
from leaderboard.editions import preview
from leaderboard.management.arguments import RefusingCommand, edition_of
from leaderboard.management.commands.open_edition import counts, line


class Command(RefusingCommand):
    """Shows what an edition would change."""

    help = "Show what publishing an edition would change, as a table, CSV or JSON."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """SPLIT, NUMBER and the format."""
        parser.add_argument("split")
        parser.add_argument("number", type=int)
        parser.add_argument("--format", choices=["table", "csv", "json"], default="table")

    def handle(self, *args: Any, **options: Any) -> None:
        """Print the preview."""
        found = preview.preview(edition_of(options))
        getattr(self, f"_{options['format']}")(found)

    def _json(self, found: preview.Preview) -> None:
        self.stdout.write(json.dumps(preview.rows(found), indent=2))

    def _csv(self, found: preview.Preview) -> None:
        self.stdout.write("".join(csv_lines(preview.rows(found), columns=found.columns)), ending="")

    def _table(self, found: preview.Preview) -> None:
        self.stdout.write(
            f"{found.edition} against edition {found.replaces}: {counts(found.truth)}; "
            f"{counted(found.n_changed, 'entry changes', 'entries change')}, "
            f"{counted(found.n_moved, 'changes', 'change')} rank, "
            f"{counted(found.n_newly_rejected, 'becomes', 'become')} rejected."
        )
        self.stdout.write(line(found.progress))
        for change in found.entries:
            delta, decimals = change.delta["mid"], max(change.old_decimals, change.new_decimals)
            self.stdout.write(
                f"{_rank(change.old_rank)} → {_rank(change.new_rank)}  {change.method} ({change.team})  "
                f"MiD {_value(change.old['mid'], change.old_decimals)} → "
                f"{_value(change.new['mid'], change.new_decimals)} "
                f"({'–' if delta is None else f'{delta:+.{decimals}f}'})  {change.new_status}"
            )
            for problem in change.problems[:1]:
                self.stdout.write(f"       {problem['message']}")
        if n_left := len(found.changes) - len(found.entries):
            self.stdout.write(
                f"Not listed, because rejected in both editions: {n_left}; CSV and JSON have all."
            )


def _rank(rank: int | None) -> str:
    return f"{rank or '–':>4}"


def _value(value: float | None, decimals: int) -> str:
    return "–" if value is None else f"{value:.{decimals}f}"
