"""`manage.py restore DIR`."""

from argparse import ArgumentParser
from typing import Any

from django.core.management.base import BaseCommand, CommandError
from django.db import Error as DatabaseProblem

from evaluator.counting import counted
from leaderboard.backups import contents
from leaderboard.backups.restore import restore


class Command(BaseCommand):
    help = "Restore a backup into a fresh place, as the owner of the tables, and verify every digest."
    # The database may have no table yet.
    requires_migrations_checks = False

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("dir", metavar="DIR", help="a folder that `manage.py backup` wrote")

    def handle(self, *args: Any, **options: Any) -> None:
        try:
            done = restore(source=options["dir"])
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
        for key in done.keys_away:
            self.stdout.write(
                f"Receipts of the key {key['kid']} cannot be checked here. Set TSTTC_RECEIPT_KEY as it was, "
                f"or add its public half to TSTTC_RECEIPT_OLD_KEYS: {key['x']}"
            )
        self.stdout.write(
            "Next: manage.py grant, if you have an application role; then start web and workers."
        )
