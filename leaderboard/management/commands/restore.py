"""`manage.py restore DIR`."""

from argparse import ArgumentParser
from typing import Any

from django.core.management.base import BaseCommand, CommandError
from django.db import Error as DatabaseProblem
from django.utils import timezone

from evaluator.counting import counted
from leaderboard.backups import contents
from leaderboard.backups.restore import Restored, restore
from leaderboard.management.commands.list_actions import from_database


class Command(BaseCommand):
    help = "Restore a backup into a fresh place, as the owner of the tables, and verify every digest."
    # The database may have no table yet.
    requires_migrations_checks = False

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("dir", metavar="DIR", help="a folder that `manage.py backup` wrote")

    def handle(self, *args: Any, **options: Any) -> None:
        try:
            done = restore(source=options["dir"], now=timezone.now())
        except (contents.NoBackup, OSError, DatabaseProblem) as fault:
            raise CommandError(str(fault)) from fault
        kept = done.contents
        boards = f"{counted(done.n_boards, 'board')} {'is' if done.n_boards == 1 else 'are'} the same"
        boards = f"{boards} byte for byte" if done.n_boards else "no board was compared"
        self.stdout.write(
            f"Restored the backup of {kept.made_at[:16].replace('T', ' ')} UTC. "
            f"{counted(len(kept.files), 'file')} and {len(kept.ground_truth)} of ground truth have "
            f"their digests, {boards}, and the audit log is unbroken."
        )
        if kept.boards and not done.n_boards:
            self.stdout.write(
                "Boards are compared only with the version that made the backup; this one is later."
            )
        if kept.faults or kept.known_lost:
            self.stdout.write(
                "When it was made, these files of the site were lost, damaged or unreadable:\n"
                + contents.listed_faults({**kept.faults, **kept.known_lost})
            )
        for key in done.keys_away:
            self.stdout.write(
                f"Receipts of the key {key['kid']} cannot be checked here. Set TSTTC_RECEIPT_KEY as it was, "
                f"or add its public half to TSTTC_RECEIPT_OLD_KEYS: {key['x']}"
            )
        self.stdout.write("All sessions are ended: everybody signs in again.")
        self._say_what_becomes_of_files(done)
        self._say_what_was_done_since()
        self.stdout.write(
            "Next: manage.py grant, if you have an application role; then start web and workers."
        )

    def _say_what_becomes_of_files(self, done: Restored) -> None:
        if done.store_is_of:
            self.stdout.write(
                "The file store belongs to another site, perhaps to the one that was backed up. Nothing is "
                "removed from it until you run claim_store, once no other site uses it."
            )
        self.stdout.write(
            f"Unused files are kept until {done.kept_until:%Y-%m-%d}, in case you return to a newer database."
        )

    def _say_what_was_done_since(self) -> None:
        try:
            lines = from_database(None)
        except contents.NoBackup:
            lines = [
                "What was done since the backup is undone, such as tokens that were revoked. To list it:"
            ]
            lines += [
                "manage.py list_actions --database URL, or --audit FILE with an export of the audit log."
            ]
        self.stdout.write("\n".join(lines))
