"""`manage.py export_submissions FILE`."""

from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from django.core.management.base import BaseCommand, CommandError

from evaluator.counting import counted
from evaluator.tables.formats import csv_lines, parquet_of
from leaderboard.exports import submission_tables
from leaderboard.models import Split
from leaderboard.storage import files


class Command(BaseCommand):
    help = "Write all submissions with all numbers into FILE.csv, or FILE.parquet (needs pyarrow)."

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("file", metavar="FILE", type=Path)
        parser.add_argument("--split", default="", help="only this one")
        parser.add_argument("--addresses", action="store_true", help="e-mail addresses instead of numbers")

    def handle(self, *args: Any, **options: Any) -> None:
        path: Path = options["file"]
        if options["split"] and not Split.objects.filter(pk=options["split"]).exists():
            raise CommandError(f"There is no split {options['split']!r}.")
        if path.suffix not in {".csv", ".parquet"}:
            raise CommandError(f"{path.name} ends in {path.suffix!r}; expected .csv or .parquet.")
        rows = list(submission_tables.rows(split=options["split"], has_addresses=options["addresses"]))
        try:
            with files.replacing(path) as unfinished:
                _write(unfinished, rows)
        except OSError as fault:
            raise CommandError(f"{path} cannot be written: {fault.strerror}") from fault
        self.stdout.write(f"{path}: {counted(len(rows), 'evaluation')}.")


def _write(path: Path, rows: list[dict[str, object]]) -> None:
    columns = submission_tables.columns()
    if path.suffix == ".csv":
        with path.open("w", encoding="utf-8", newline="") as out:
            out.writelines(csv_lines(rows, columns=columns))
        return
    try:
        path.write_bytes(parquet_of(rows, columns=columns))
    except ModuleNotFoundError as missing:
        raise CommandError(f"{missing}.") from missing
