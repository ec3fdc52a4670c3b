"""A database of PostgreSQL comes back as it was, and what cannot be done is said in one sentence."""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urlsplit

import psycopg
import pytest
from psycopg import sql

from leaderboard.backups import contents
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
PASSWORD = "correct-horse-battery"
CASTS = re.compile(r"::(character varying|text)(\[\])?|[()]")


REVOKE = """
import django; django.setup()
from leaderboard import audit
from leaderboard.models import User
for name in ("ada", "bob"):
    user = User.objects.get(email=f"{name}@example.org")
    audit.record_of(user, "closed", details={"reason": "It was hijacked."})
User.objects.filter(email="bob@example.org").update(password="another one")
"""


@contextmanager
def empty_database(name: str = "") -> Iterator[str]:
    name = name or f"tsttc_test_{os.urandom(6).hex()}"
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
    # Counters of wrong passwords, when the tables were made, how the backup ended, and which site this is.
    others = ("leaderboard_cache", "django_migrations", "leaderboard_backuprun", "leaderboard_installation")
    without = [f"--exclude-table-data={name}" for name in others]
    command = ["pg_dump", "--no-owner", "--no-privileges", *without, url]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    # The key of \restrict is another one each time.
    lines = [line for line in text.splitlines() if not line.startswith(("\\restrict", "\\unrestrict"))]
    # The server writes the types of a list in one of two ways, which mean the same.
    return [CASTS.sub("", line) if "ARRAY[" in line else line for line in lines]


class Source(NamedTuple):
    """A site with rows, and a backup of it that the role of the application made."""

    url: str
    url_of_role: str
    backup: Path
    commands: str  # how the programs were called


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Source]:
    try:
        check_postgres()
    except ServiceMissing as missing:
        skip_or_fail(missing)
    folder = tmp_path_factory.mktemp("source")
    data, backup, log = folder / "data", folder / "backup", folder / "log"
    program(folder / "bin" / "pg_dump", f'echo "$@" >> {log}; exec {shutil.which("pg_dump")} "$@"')
    name = f"tsttc_test_{os.urandom(6).hex()}"
    with migrated_database() as url:
        role = {"TSTTC_APPLICATION_ROLE": name, "TSTTC_APPLICATION_PASSWORD": PASSWORD}
        for command in (["-c", WORK, str(REPOSITORY / "examples/truth.csv")], ["manage.py", "grant"]):
            done = run(*command, url=url, data=data, **role)
            assert done.returncode == 0, done.stderr
        server = urlsplit(url)
        of_role = f"postgres://{name}:{PASSWORD}@{server.hostname}:{server.port}{server.path}"
        done = run("manage.py", "backup", str(backup), url=of_role, data=data, PATH=path_of(folder / "bin"))
        assert done.returncode == 0, done.stderr
        yield Source(url, of_role, backup, log.read_text())
    with psycopg.connect(POSTGRES_ADMIN_URL, autocommit=True) as admin:
        admin.execute(sql.SQL("DROP ROLE {}").format(sql.Identifier(name)))


def program(path: Path, text: str) -> None:
    path.parent.mkdir(exist_ok=True)
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)


def path_of(folder: Path) -> str:
    return f"{folder}:{os.environ['PATH']}"


@pytest.mark.parametrize("new_database", [empty_database, migrated_database])
def test_what_was_restored_into_a_fresh_database_is_what_was_saved_and_goes_on(
    source: Source, new_database: Callable[[], AbstractContextManager[str]], tmp_path: Path
) -> None:
    with new_database() as new:
        done = run("manage.py", "restore", str(source.backup), url=new, data=tmp_path)
        assert "1 board is the same byte for byte" in done.stdout, done.stderr
        assert content(new) == content(source.url)
        again = run("manage.py", "restore", str(source.backup), url=new, data=tmp_path)
        assert "The database has users already" in again.stderr
        assert content(new) == content(source.url)
        went_on = run("-c", GO_ON, url=new, data=tmp_path)
        assert went_on.returncode == 0, went_on.stderr
        assert "append-only" in went_on.stdout


def test_a_restore_lists_what_the_newer_database_beside_it_has_done(source: Source, tmp_path: Path) -> None:
    with empty_database() as new, empty_database(f"{urlsplit(new).path[1:]}_newer") as newer:
        done = run("manage.py", "restore", str(source.backup), url=newer, data=tmp_path / "newer")
        assert "manage.py list_actions --database URL" in done.stdout, done.stderr
        assert run("-c", REVOKE, url=newer, data=tmp_path).returncode == 0
        done = run("manage.py", "restore", str(source.backup), url=new, data=tmp_path / "new")
        for name in ("ada", "bob"):
            assert f"User {name}@example.org: closed (reason: It was hijacked.)" in done.stdout, done.stderr
        assert "  bob@example.org: password\n" in done.stdout
        assert "ada@example.org: password" not in done.stdout
        assert "Unused files are kept until 20" in done.stdout
        listed = run("manage.py", "list_actions", "--database", newer, url=new, data=tmp_path / "new")
        assert "To be done again first" in listed.stdout, listed.stderr


def test_a_second_site_that_is_restored_into_the_store_of_the_first_does_not_clean_it(
    source: Source, tmp_path: Path
) -> None:
    data = source.backup.parent / "data"
    store = tmp_path / "files"
    shutil.copytree(data / "files", store)
    code = "import django; django.setup(); from django.utils import timezone; " + (
        "from leaderboard.storage import ownership; print(ownership.may_remove_files(now=timezone.now()))"
    )
    first = run("-c", code, url=source.url, data=data, TSTTC_FILES_DIR=str(store))
    assert first.stdout == "True\n", first.stderr
    mark = (store / "site.json").read_bytes()
    with empty_database() as new:
        options = {"url": new, "data": tmp_path / "second", "TSTTC_FILES_DIR": str(store)}
        done = run("manage.py", "restore", str(source.backup), **options)  # type: ignore[arg-type]  # of two kinds
        assert "The file store belongs to another site" in done.stdout, done.stderr
        again = run("-c", code, **options)  # type: ignore[arg-type]  # of two kinds
        assert again.stdout.endswith("False\n")
    assert (store / "site.json").read_bytes() == mark


def test_the_command_line_of_the_program_has_no_password(source: Source) -> None:
    assert "--format=custom" in source.commands
    assert PASSWORD not in source.commands


def test_an_archive_that_cannot_be_read_leaves_the_database_as_it_was(source: Source, tmp_path: Path) -> None:
    folder = tmp_path / "backup"
    shutil.copytree(source.backup, folder)
    [archive] = folder.glob("database-*/leaderboard.dump")
    archive.write_bytes(archive.read_bytes()[:-100])
    made = json.loads((folder / contents.LIST).read_text())
    made["database_sha256"] = contents.digest_at(archive)
    (folder / contents.LIST).write_text(json.dumps(made))
    with empty_database() as new:
        before = content(new)
        done = run("manage.py", "restore", str(folder), url=new, data=tmp_path / "new")
        assert "pg_restore failed, and the database is as it was: pg_restore: error: " in done.stderr
        assert content(new) == before


def test_a_program_that_is_not_there_is_named(source: Source, tmp_path: Path) -> None:
    message = "pg_dump cannot be run here (No such file or directory); expected that of the server's"
    data = source.backup.parent / "data"
    new, path = tmp_path / "new", str(tmp_path / "bin")
    done = run("manage.py", "backup", str(new), url=source.url_of_role, data=data, PATH=path)
    assert f"There is no new backup. {message}" in done.stderr
    assert list(new.iterdir()) == []
