"""A database of PostgreSQL comes back as it was, and what cannot be done is said in one sentence."""

import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import psycopg
import pytest
from psycopg import sql

from tests.prepared import database_url, migrated_database
from tests.services import POSTGRES_ADMIN_URL, REPOSITORY, ServiceMissing, check_postgres, skip_or_fail

pytestmark = [pytest.mark.services, pytest.mark.slow]

WORK = """
import django; django.setup()
import sys
from django.core.management import call_command
from leaderboard.models import User
call_command("import_truth", "test", sys.argv[1])
for name in ("ada", "bob"):
    User.objects.create(email=f"{name}@example.org", name="O'Hara \\\\ “τ”\\t")
"""
# Somebody works on: the ids go on where they were, and the audit log refuses to be changed.
GO_ON = """
import django; django.setup()
from django.core.management import call_command
from django.db import IntegrityError, connection
from leaderboard.models import User
User.objects.create(email="eve@example.org")
call_command("verify_audit")
try:
    connection.cursor().execute("DELETE FROM leaderboard_auditevent")
except IntegrityError as fault:
    print(fault)
"""
CASTS = re.compile(r"::(character varying|text)(\[\])?|[()]")


@contextmanager
def empty_database() -> Iterator[str]:
    name = f"tsttc_test_{os.urandom(6).hex()}"
    with psycopg.connect(POSTGRES_ADMIN_URL, autocommit=True) as admin:
        admin.execute(sql.SQL("CREATE DATABASE {} TEMPLATE template0").format(sql.Identifier(name)))
        try:
            yield database_url(name)
        finally:
            admin.execute(sql.SQL("DROP DATABASE {} WITH (FORCE)").format(sql.Identifier(name)))


def run(*command: str, url: str, data: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    environment = {name: text for name, text in os.environ.items() if not name.startswith("TSTTC_")}
    return subprocess.run(
        [sys.executable, *command],
        cwd=REPOSITORY,
        env=environment
        | {"DJANGO_SETTINGS_MODULE": "leaderboard.settings", "TSTTC_DATABASE_URL": url}
        | {"TSTTC_DATA_DIR": str(data), **variables},
        capture_output=True,
        text=True,
        check=False,
    )


def content(url: str) -> list[str]:
    """Tables, rows, triggers, constraints and sequences, in words."""
    # Counters of wrong passwords, and when the tables were made.
    without = [f"--exclude-table-data={name}" for name in ("leaderboard_cache", "django_migrations")]
    command = ["pg_dump", "--no-owner", "--no-privileges", *without, url]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    # The key of \restrict is another one each time.
    lines = [line for line in text.splitlines() if not line.startswith(("\\restrict", "\\unrestrict"))]
    # The server writes the types of a list in one of two ways, which mean the same.
    return [CASTS.sub("", line) if "ARRAY[" in line else line for line in lines]


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Path]]:
    """A site with rows, and its data directory."""
    data = tmp_path_factory.mktemp("source")
    try:
        check_postgres()
    except ServiceMissing as missing:
        skip_or_fail(missing)
    with migrated_database() as url:
        done = run("-c", WORK, str(REPOSITORY / "examples/truth.csv"), url=url, data=data)
        assert done.returncode == 0, done.stderr
        yield url, data


@pytest.mark.parametrize("place", [empty_database, migrated_database])
def test_what_was_restored_into_a_fresh_database_is_what_was_saved_and_goes_on(
    source: tuple[str, Path], place: Callable[[], AbstractContextManager[str]], tmp_path: Path
) -> None:
    url, data = source
    done = run("manage.py", "backup", str(tmp_path / "backup"), url=url, data=data)
    assert done.returncode == 0, done.stderr
    with place() as new:
        done = run("manage.py", "restore", str(tmp_path / "backup"), url=new, data=tmp_path / "new")
        assert "1 board is the same byte for byte" in done.stdout, done.stderr
        assert content(new) == content(url)
        again = run("manage.py", "restore", str(tmp_path / "backup"), url=new, data=tmp_path / "new")
        assert "The database has users already" in again.stderr
        assert content(new) == content(url)
        went_on = run("-c", GO_ON, url=new, data=tmp_path / "new")
        assert went_on.returncode == 0, went_on.stderr
        assert "append-only" in went_on.stdout
