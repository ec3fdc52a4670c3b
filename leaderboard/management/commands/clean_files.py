"""`manage.py clean_files [--remove]`."""

from argparse import ArgumentParser
from typing import Any

from django.core.management.base import BaseCommand, CommandError
from django.utils import timezone

from evaluator.counting import counted
from leaderboard.storage import orphans


class Command(BaseCommand):
    """Lists or removes files that no submission names."""

    help = "List stored files without a submission that are older than a day; --remove deletes them."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Whether to remove."""
        parser.add_argument(
            "--remove", action="store_true", help="delete the listed files, each with an audit event"
        )

    def handle(self, *args: Any, **options: Any) -> None:
        """Go through the store, and say what was found and done."""
        try:
            self._files(remove=options["remove"])
        except OSError as fault:
            raise CommandError(f"The file store does not answer: {fault.strerror or fault}") from fault
        for path in orphans.leftovers():
            self.stdout.write(f"half-written: {path.name}")
            if options["remove"]:
                path.unlink(missing_ok=True)

    def _files(self, *, remove: bool) -> None:
        now = timezone.now()
        n_found = n_removed = n_bytes = 0
        for orphan in orphans.orphans(now=now):
            self.stdout.write(
                f"{orphan.name}  {counted(orphan.size_bytes, 'byte')}, "
                f"written {orphan.modified_at:%Y-%m-%d %H:%M} UTC"
            )
            n_found += 1
            n_bytes += orphan.size_bytes
            n_removed += remove and orphans.remove(orphan, now=now)
        found = f"{counted(n_found, 'file')} without a submission, {counted(n_bytes, 'byte')}"
        done = f"removed {n_removed}" if remove else "nothing was removed (--remove does)"
        self.stdout.write(f"{found}; {done}.")
