"""The rows of a database as one file, and back: pg_dump and pg_restore, or SQLite's own backup."""

import os
import sqlite3
import subprocess
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Final

from django.contrib.auth import get_user_model
from django.core.management import call_command
from django.db import connection, transaction
from django.db.migrations.executor import MigrationExecutor

from leaderboard.backups import contents
from leaderboard.backups.contents import Contents, NoBackup
from leaderboard.models import GroundTruth, Submission
from leaderboard.storage.files import replacing

ROWS: Final = {"postgresql": "leaderboard.dump", "sqlite": "leaderboard.sqlite3"}
_SNAPSHOT: Final = "SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY"
# Owner and rights are those of the place; `grant` gives the rights.
_OURS_ALONE: Final = ("--no-owner", "--no-privileges")


@contextmanager
def one_moment() -> Iterator[None]:
    """Read everything as of one moment, while others may write. On PostgreSQL this blocks no one."""
    with transaction.atomic():
        if connection.vendor == "postgresql":
            with connection.cursor() as cursor:
                cursor.execute(_SNAPSHOT)
        yield


def save(folder: Path) -> Path:
    """Write every row into a file of the folder; to be called within `one_moment`. Raises `NoBackup`."""
    path = folder / ROWS[connection.vendor]
    if connection.vendor == "sqlite":
        # Nobody writes while our transaction lasts.
        with replacing(path) as unfinished:
            unfinished.write_bytes(connection.connection.serialize())
    else:
        with connection.cursor() as cursor:
            cursor.execute("SELECT pg_export_snapshot()")
            (moment,) = cursor.fetchone()
        # The cache counts wrong passwords; what it has expires within hours.
        options = ("--format=custom", f"--snapshot={moment}", "--exclude-table-data=leaderboard_cache")
        _run("pg_dump", *options, *_OURS_ALONE, f"--file={path}")
    return path


def require_fresh(kept: Contents) -> None:
    """Refuse a database that is in use or of another version. Raises `NoBackup`."""
    if get_user_model()._meta.db_table not in connection.introspection.table_names():
        return
    for model in (get_user_model(), Submission, GroundTruth):
        if model.objects.exists():
            raise NoBackup(
                f"The database has {model._meta.verbose_name_plural} already; expected a new database, "
                "without tables or just migrated. Nothing was changed."
            )
    if contents.applied_migrations() != kept.migrations:
        raise NoBackup(
            "The database has other migrations than the backup; expected a database without tables. "
            "Nothing was changed."
        )


def require_known(kept: Contents) -> None:
    """Refuse a backup that this version or this kind of database cannot take. Raises `NoBackup`."""
    if kept.vendor != connection.vendor:
        raise NoBackup(
            f"The backup is one of {kept.vendor}, the database is {connection.vendor}; expected the same."
        )
    known = set(MigrationExecutor(connection).loader.disk_migrations)
    newer = [f"{app} {name}" for app, name in kept.migrations if (app, name) not in known]
    if newer:
        raise NoBackup(
            f"The backup has the migration {newer[-1]}, which this version does not know; expected the "
            "version that made the backup, or a later one."
        )


def load(path: Path) -> None:
    """Put the rows into a fresh database, all or none, then migrate it. Raises `NoBackup`."""
    connection.ensure_connection()
    if connection.vendor == "sqlite":
        with closing(sqlite3.connect(path)) as source:
            source.backup(connection.connection)
    else:
        # The schema alone: what else is in a database, such as extensions, belongs to its server.
        options = ("--clean", "--if-exists", "--single-transaction", "--exit-on-error", "--schema=public")
        _run("pg_restore", *options, *_OURS_ALONE, str(path))
    call_command("migrate", interactive=False, verbosity=0)


def _run(program: str, *arguments: str) -> None:
    # As for dbshell. Everybody can read a command line: the password is among the variables.
    (_, *options, name), variables = connection.client.settings_to_cmd_args_env(connection.settings_dict, [])
    try:
        done = subprocess.run(  # noqa: S603 - PostgreSQL's own programs, nothing of a visitor's
            [program, *options, f"--dbname={name}", *arguments],
            env=os.environ | (variables or {}),
            capture_output=True,
            text=True,
            check=False,
        )
    except OSError as fault:
        raise NoBackup(
            f"{program} cannot be run here ({fault.strerror}); expected that of the server's PostgreSQL or a "
            "later one, for example from Debian's postgresql-client."
        ) from None
    if done.returncode:
        raise NoBackup(f"{program} failed, and the database is as it was: {done.stderr.strip()}")
