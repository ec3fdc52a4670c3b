"""`manage.py list_actions`."""

from argparse import ArgumentParser
from pathlib import Path
from typing import Any

import environ
from django.core.management.base import BaseCommand, CommandError

from leaderboard.backups import actions
from leaderboard.backups.contents import NoBackup


class Command(BaseCommand):
    help = (
        "After a restore: list what was done since the backup and is to be done again, such as tokens that "
        "were revoked, from a newer database or from an export of its audit log. Nothing is changed."
    )

    def add_arguments(self, parser: ArgumentParser) -> None:
        source = parser.add_mutually_exclusive_group()
        source.add_argument(
            "--database",
            metavar="URL",
            help="the newer database; by default, the one beside this one whose name ends with _newer",
        )
        source.add_argument("--audit", metavar="FILE", help="an export of /maintain/audit/, as JSON")

    def handle(self, *args: Any, **options: Any) -> None:
        try:
            lines = (
                actions.since_backup(actions.exported(Path(options["audit"]))).lines()
                if options["audit"]
                else from_database(options["database"])
            )
        except NoBackup as fault:
            raise CommandError(str(fault)) from fault
        self.stdout.write("\n".join(lines))


def from_database(url: str | None) -> list[str]:
    """Read the newer database. Raises `NoBackup`."""
    config = environ.Env.db_url_config(url) if url and "://" in url else None
    if url and not (config and config["ENGINE"]):
        # Without the text: it may have a password.
        raise NoBackup("The address is not understood; expected postgres://user:password@host/name.")
    with actions.newer_database(config) as alias:
        lines = actions.since_backup(actions.events_of(alias)).lines()
        changed = actions.changed_sign_ins(alias)
    if changed:
        lines += ["These people signed in otherwise in the newer database. Tell them that this is undone:"]
        lines += changed
    return lines
