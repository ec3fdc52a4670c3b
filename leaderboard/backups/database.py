"""The rows of a database as files, and back: COPY on PostgreSQL, the whole file on SQLite.

No program beside Python is needed, so a container and a machine do the same, and a backup of one version of
PostgreSQL can be restored into another.
"""

import gzip
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from django.contrib.auth import get_user_model
from django.core.management import call_command
from django.db import connection, transaction
from django.db.backends.utils import CursorWrapper
from django.db.migrations.executor import MigrationExecutor
from psycopg import sql

from leaderboard.backups.contents import Contents, NoBackup, RowFile, digest_at
from leaderboard.models import GroundTruth, Submission
from leaderboard.storage.files import CHUNK_BYTES, replacing

SQLITE: Final = "leaderboard.sqlite3"
# `migrate` writes the first; the second counts wrong passwords, and expires within hours.
_LEFT_OUT: Final = frozenset({"django_migrations", "leaderboard_cache"})
_COMPRESSION: Final = 3
# The database computes the others by itself.
_COLUMNS: Final = (
    "SELECT column_name FROM information_schema.columns WHERE table_schema = current_schema() "
    "AND table_name = %s AND is_generated = 'NEVER' ORDER BY ordinal_position"
)
_SNAPSHOT: Final = "SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY"


@contextmanager
def one_moment() -> Iterator[None]:
    """Read everything as it is now, whatever others write meanwhile. On PostgreSQL nobody waits."""
    with transaction.atomic():
        if connection.vendor == "postgresql":
            with connection.cursor() as cursor:
                cursor.execute(_SNAPSHOT)
        yield


def save(folder: Path) -> list[RowFile]:
    """Write every row into files of a folder; to be called within `one_moment`."""
    if connection.vendor == "sqlite":
        return [_save_sqlite(folder / SQLITE)]
    with connection.cursor() as cursor:
        tables = sorted(set(connection.introspection.table_names(cursor)) - _LEFT_OUT)
        return [_save_table(cursor, table, folder / f"{table}.copy.gz") for table in tables]


def _save_table(cursor: CursorWrapper, table: str, path: Path) -> RowFile:
    cursor.execute(_COLUMNS, [table])
    columns = [name for (name,) in cursor.fetchall()]
    statement = sql.SQL("COPY {} ({}) TO STDOUT").format(
        sql.Identifier(table), sql.SQL(", ").join(map(sql.Identifier, columns))
    )
    with (
        replacing(path) as unfinished,
        gzip.open(unfinished, "wb", compresslevel=_COMPRESSION) as out,
        connection.wrap_database_errors,
        _driver(cursor).copy(statement) as rows,
    ):
        for chunk in rows:
            out.write(chunk)
    return RowFile(table, columns, digest_at(path))


def _save_sqlite(path: Path) -> RowFile:
    # Nobody writes while our transaction lasts, so another connection reads what it reads.
    source = sqlite3.connect(f"file:{connection.settings_dict['NAME']}?mode=ro", uri=True)
    with replacing(path) as unfinished:
        target = sqlite3.connect(unfinished)
        try:
            source.backup(target)
        finally:
            target.close()
            source.close()
    return RowFile(path.name, [], digest_at(path))


def require_fresh() -> None:
    """Refuse a database in which somebody has worked. Raises `NoBackup`."""
    if get_user_model()._meta.db_table not in connection.introspection.table_names():
        return
    for model in (get_user_model(), Submission, GroundTruth):
        if model.objects.exists():
            raise NoBackup(
                f"The database has {model._meta.verbose_name_plural} already; expected a new database, "
                "without tables or just migrated. Nothing was changed."
            )


def require_known(contents: Contents) -> None:
    """Refuse a backup that this version or this kind of database cannot take. Raises `NoBackup`."""
    if contents.vendor != connection.vendor:
        raise NoBackup(
            f"The backup is one of {contents.vendor}, the database is {connection.vendor}; expected the same."
        )
    known = set(MigrationExecutor(connection).loader.disk_migrations)
    newer = [f"{app} {name}" for app, name in contents.migrations if (app, name) not in known]
    if newer:
        raise NoBackup(
            f"The backup has the migration {newer[-1]}, which this version does not know; expected the "
            "version that made the backup, or a later one."
        )


def load(folder: Path, contents: Contents) -> None:
    """Put the rows into a fresh database, as its owner, all or none; then bring it to this version."""
    if connection.vendor == "sqlite":
        connection.ensure_connection()
        source = sqlite3.connect(folder / SQLITE)
        try:
            source.backup(connection.connection)
        finally:
            source.close()
    else:
        _migrate_to(contents)
        with transaction.atomic(), connection.cursor() as cursor:
            _load_tables(cursor, folder, contents.parts)
    call_command("migrate", interactive=False, verbosity=0)


def _migrate_to(contents: Contents) -> None:
    """Make the tables that the backup knows, and no later ones."""
    executor = MigrationExecutor(connection)
    wanted = {(app, name) for app, name in contents.migrations}
    later = set(executor.loader.applied_migrations) - wanted
    if later:
        app, name = min(later)
        raise NoBackup(
            f"The database has the migration {app} {name}, which is later than the backup; expected a "
            "database without tables. Nothing was changed."
        )
    nodes = executor.loader.graph.node_map
    followed = {parent.key for key in wanted for parent in nodes[key].parents if parent.key[0] == key[0]}
    executor.migrate(sorted(wanted - followed))


def _load_tables(cursor: CursorWrapper, folder: Path, parts: list[RowFile]) -> None:
    names = [sql.Identifier(part.name) for part in parts]
    # The triggers of the audit log refuse to empty it; only its owner can say so.
    switch = sql.SQL("ALTER TABLE {} {} TRIGGER USER")
    for name in names:
        _execute(cursor, switch.format(name, sql.SQL("DISABLE")))
    _execute(cursor, sql.SQL("TRUNCATE {}").format(sql.SQL(", ").join(names)))
    for part in parts:
        columns = sql.SQL(", ").join(map(sql.Identifier, part.columns))
        statement = sql.SQL("COPY {} ({}) FROM STDIN").format(sql.Identifier(part.name), columns)
        with (
            gzip.open(folder / f"{part.name}.copy.gz", "rb") as rows,
            connection.wrap_database_errors,
            _driver(cursor).copy(statement) as copy,
        ):
            while chunk := rows.read(CHUNK_BYTES):
                copy.write(chunk)
    # Foreign keys are checked at the end of a transaction, and a table that waits for that cannot be altered.
    cursor.execute("SET CONSTRAINTS ALL IMMEDIATE")
    for part, name in zip(parts, names, strict=True):
        _execute(cursor, switch.format(name, sql.SQL("ENABLE")))
        for sequence in connection.introspection.get_sequences(cursor, part.name):
            last = sql.SQL("SELECT setval(pg_get_serial_sequence({}, {}), max({})) FROM {}").format(
                sql.Literal(part.name),
                sql.Literal(sequence["column"]),
                sql.Identifier(sequence["column"]),
                name,
            )
            _execute(cursor, last)


def _execute(cursor: CursorWrapper, statement: sql.Composed) -> None:
    cursor.execute(statement.as_string(_driver(cursor).connection))


def _driver(cursor: CursorWrapper) -> Any:
    """The driver's own cursor, which knows COPY."""
    return cursor.cursor
