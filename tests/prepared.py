"""What many tests need and one run makes once: databases that have all tables, static files, compiled code.

To migrate takes ten seconds of a processor, to copy what was migrated a fifth of one. All processes of a run
share a folder, which the environment names. Whoever needs something first makes it, and the rest wait.
"""

import atexit
import fcntl
import os
import secrets
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import psycopg
import pytest
from psycopg import sql

from tests.services import (
    POSTGRES_ADMIN_URL,
    REPOSITORY,
    ServiceMissing,
    check_postgres,
    database_url,
    environment_of_its_own,
    skip_or_fail,
)

_FOLDER = "TSTTC_TEST_RUN"
_TEMPLATE = "tsttc_template_"
# A run that was killed drops nothing; one takes minutes.
_FORGOTTEN_S = 6 * 3600
# A folder that the machine keeps in its memory, and what has to be free there: a run has used 0.6 GB.
_MEMORY = Path("/dev/shm")  # where Linux has one
_ROOM_BYTES = 4 << 30


def begin() -> None:
    """Make the folder, unless the parent process has one; it is removed when this process ends.

    What is compiled is kept, even on a machine that says otherwise: a run starts hundreds of processes, and
    each would compile the leaderboard for half a second, and the tests for ten.

    Temporary folders of the whole run lie in memory where there is room, unless `TMPDIR` says where: the
    tests flush and remove thousands of small files, and otherwise wait for the disk half of the time.
    """
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    sys.dont_write_bytecode = False
    if _FOLDER not in os.environ:
        if "TMPDIR" not in os.environ and _memory_has_room():
            os.environ["TMPDIR"] = tempfile.tempdir = str(_MEMORY)
        os.environ[_FOLDER] = tempfile.mkdtemp(prefix="tsttc-run-")
        atexit.register(_end, Path(os.environ[_FOLDER]), os.getpid())


def _memory_has_room() -> bool:
    """Whether the folder in memory takes a whole run, and programs may be started from it."""
    try:
        there = os.statvfs(_MEMORY)
    except OSError:
        return False
    is_open = os.access(_MEMORY, os.W_OK) and not there.f_flag & os.ST_NOEXEC
    return is_open and there.f_bavail * there.f_frsize >= _ROOM_BYTES


def _end(folder: Path, pid: int) -> None:
    if pid != os.getpid():
        return  # a fork of the process that it belongs to
    template = folder / "postgres"
    if template.exists():
        with psycopg.connect(POSTGRES_ADMIN_URL, autocommit=True) as admin:
            _drop(admin, template.read_text())
    shutil.rmtree(folder, ignore_errors=True)


def _once(name: str, make: Callable[[Path], None]) -> Path:
    """What is kept under that name, made if it is not there yet. What breaks in the middle leaves nothing."""
    begin()
    folder = Path(os.environ[_FOLDER])
    with (folder / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # let go when the file is closed
        if not (folder / name).exists():
            unfinished = folder / f"{name}.unfinished"
            make(unfinished)
            unfinished.rename(folder / name)
    return folder / name


def _manage(*arguments: str, **environment: str) -> None:
    with tempfile.TemporaryDirectory() as data:
        done = subprocess.run(
            [sys.executable, "manage.py", *arguments],
            cwd=REPOSITORY,
            env=environment_of_its_own() | {"TSTTC_DATA_DIR": data} | environment,
            capture_output=True,
            text=True,
            check=False,
        )
    assert done.returncode == 0, done.stdout + done.stderr


# --- what is kept ----------------------------------------------------------------------------------------


def static_files() -> Path:
    """The folder of static files as `collectstatic` leaves it. Nobody writes to it."""
    return _once("static", lambda path: _manage("collectstatic", "--no-input", TSTTC_STATIC_ROOT=str(path)))


def put_sqlite(path: Path) -> None:
    """Make an SQLite database with all tables there."""
    shutil.copyfile(_once("sqlite", _migrate_sqlite), path)


def _migrate_sqlite(path: Path) -> None:
    _manage("migrate", "--no-input", TSTTC_DATABASE_URL=f"sqlite:///{path}")


@contextmanager
def sqlite_in_memory(name: str) -> Iterator[None]:
    """Make an SQLite database of that URI, which this process shares in its memory, with all tables.

    It lasts as long as the context, or as any connection to it.
    """
    kept = _once("sqlite", _migrate_sqlite)
    with closing(sqlite3.connect(name, uri=True)) as memory:
        with closing(sqlite3.connect(kept)) as made:
            made.backup(memory)
        yield


def template() -> str:
    """The name of a database on the test server that has all tables, to be copied.

    Raises `ServiceMissing`.
    """
    check_postgres()
    return _once("postgres", _make_template).read_text()


def dump() -> Path:
    """The same as statements for `psql`. Raises `ServiceMissing`."""
    template()
    return Path(os.environ[_FOLDER]) / "dump.sql"


@contextmanager
def migrated_database() -> Iterator[str]:
    """The URL of a PostgreSQL database with all tables, dropped at the end even if clients are connected.

    Raises `ServiceMissing`.
    """
    source, name = template(), f"tsttc_test_{secrets.token_hex(6)}"
    with psycopg.connect(POSTGRES_ADMIN_URL, autocommit=True) as admin:
        statement = sql.SQL("CREATE DATABASE {} TEMPLATE {}")
        admin.execute(statement.format(sql.Identifier(name), sql.Identifier(source)))
        try:
            yield database_url(name)
        finally:
            _drop(admin, name)


@pytest.fixture(scope="module")
def postgres_url() -> Iterator[str]:
    """A PostgreSQL database with all tables, of this module's own."""
    try:
        with migrated_database() as url:
            yield url
    except ServiceMissing as missing:
        skip_or_fail(missing)


def _make_template(path: Path) -> None:
    name = f"{_TEMPLATE}{int(time.time())}_{secrets.token_hex(6)}"
    with psycopg.connect(POSTGRES_ADMIN_URL, autocommit=True) as admin:
        _drop_forgotten(admin)
        admin.execute(sql.SQL("CREATE DATABASE {}").format(sql.Identifier(name)))
        try:
            _manage("migrate", "--no-input", TSTTC_DATABASE_URL=database_url(name))
            command = ["pg_dump", "--no-owner", "--file", path.with_name("dump.sql"), database_url(name)]
            subprocess.run(command, check=True)
        except BaseException:
            _drop(admin, name)
            raise
        # What has connections cannot be copied: from now on there are none.
        admin.execute(sql.SQL("ALTER DATABASE {} ALLOW_CONNECTIONS false").format(sql.Identifier(name)))
    path.write_text(name)


def _drop_forgotten(admin: "psycopg.Connection[tuple[object, ...]]") -> None:
    """Templates of runs that were killed."""
    names = admin.execute("SELECT datname FROM pg_database WHERE datname LIKE %s", [f"{_TEMPLATE}%"])
    for (name,) in names.fetchall():
        made_at = int(str(name).removeprefix(_TEMPLATE).partition("_")[0])
        if time.time() - made_at > _FORGOTTEN_S:
            _drop(admin, str(name))


def _drop(admin: "psycopg.Connection[tuple[object, ...]]", name: str) -> None:
    admin.execute(sql.SQL("DROP DATABASE IF EXISTS {} WITH (FORCE)").format(sql.Identifier(name)))
