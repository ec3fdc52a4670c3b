"""A backup says what it is, refuses what would do harm, and comes back whole or not at all."""

import hashlib
import re
from pathlib import Path

import pytest
from django.conf import settings as configured
from django.core.files.base import ContentFile
from django.core.management import CommandError, call_command
from django.db import connection

from leaderboard.backups import backup, contents, restore
from leaderboard.backups.contents import Contents, NoBackup
from leaderboard.storage import files

FILE = f"predictions/ab/{'ab' * 32}.json"


def listed(folder: Path, **changed: object) -> Contents:
    """A backup of one file, without rows."""
    kept = folder / contents.FILES / FILE
    kept.parent.mkdir(parents=True)
    kept.write_bytes(b"{}")
    made = Contents(
        **{
            "format": contents.FORMAT,
            "made_at": "2026-11-22T10:00:00+00:00",
            "vendor": "sqlite",
            "migrations": [],
            "database": "database-1",
            "parts": [],
            "files": {FILE: contents.digest_at(kept)},
            "ground_truth": {},
            "missing": [],
            "keys": {"keys": []},
            "boards": {},
            "audit": "0" * 64,
            **changed,
        }
    )
    made.write(folder)
    return made


@pytest.mark.parametrize("text", ["", " "])
def test_an_empty_name_is_no_folder(text: str) -> None:
    with pytest.raises(CommandError, match=r"no name \(an empty variable\?\)"):
        call_command("backup", text)
    with pytest.raises(CommandError, match="no name"):
        call_command("restore", text)


def test_an_empty_variable_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TSTTC_FILES_DIR", "")
    with pytest.raises(CommandError, match="TSTTC_FILES_DIR is empty"):
        call_command("backup", str(tmp_path / "backup"))
    assert not (tmp_path / "backup").exists()


def test_a_folder_of_the_sites_own_is_refused(tmp_path: Path) -> None:
    for folder in ("/", str(tmp_path), str(configured.FILES_DIR), str(configured.GROUND_TRUTH_DIR / "x")):
        with pytest.raises(NoBackup, match="lie in each other"):
            contents.folder_of(folder)


def test_a_folder_with_other_things_is_left_alone(tmp_path: Path) -> None:
    folder = tmp_path / "papers"
    folder.mkdir()
    (folder / "thesis.tex").write_text("x")
    with pytest.raises(CommandError, match=r"holds 'thesis.tex'; expected an empty folder"):
        call_command("backup", str(folder))
    assert [path.name for path in folder.iterdir()] == ["thesis.tex"]


def test_a_damaged_backup_is_not_restored(tmp_path: Path) -> None:
    folder = tmp_path / "backup"
    listed(folder)
    (folder / contents.FILES / FILE).write_bytes(b"[]")
    with pytest.raises(CommandError, match=r"damaged; nothing was changed. 1 of 1 files[^$]*predictions/ab"):
        call_command("restore", str(folder))
    assert not configured.FILES_DIR.exists()


EVIL = "import os"
OUTSIDE = ("../evil.py", "/tmp/evil.py", "sub/evil.py", "..", ".", "", "a\0b")


@pytest.mark.django_db
@pytest.mark.parametrize("name", OUTSIDE)
@pytest.mark.parametrize("entry", ["database", "parts", "ground_truth", "files"])
def test_a_name_that_leads_out_of_its_directory_is_refused_before_anything_is_written(
    entry: str, name: str, tmp_path: Path
) -> None:
    folder = tmp_path / "backup"
    digest = hashlib.sha256(EVIL.encode()).hexdigest()
    row_file = {"name": name, "columns": [], "sha256": digest}
    changed = {"database": name, "parts": [row_file], "ground_truth": {name: digest}, "files": {name: digest}}
    listed(folder, **{entry: changed[entry]}, vendor=connection.vendor)
    # It is there, with the digest that the list has: the backup is whole.
    for base in ("ground-truth", "files", "database-1"):
        (folder / base / "sub").mkdir(parents=True, exist_ok=True)
        (folder / base / "sub" / "evil.py").write_text(EVIL)
    (folder / "evil.py").write_text(EVIL)
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(
        CommandError, match=re.escape(f"names {name!r} in {entry.replace('_', '-')}; expected")
    ):
        call_command("restore", str(folder))
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.django_db
@pytest.mark.parametrize(
    "name", ["ground-truth/seed.key", f"predictions/../{'ab' * 32}.json", f"predictions/ab/{'AB' * 32}.json"]
)
def test_the_store_takes_back_what_it_has_names_for(name: str, tmp_path: Path) -> None:
    listed(tmp_path / "backup", files={name: "0" * 64})
    with pytest.raises(CommandError, match="in files; expected the name of a prediction file"):
        call_command("restore", str(tmp_path / "backup"))
    for own in (files.predictions_name("ab" * 32), files.manifest_name("ab" * 32), FILE):
        assert files.is_name(own)
    assert files.is_name(files.aligned_name(manifest_digest="ab" * 32, digest="cd" * 32))


@pytest.mark.parametrize(
    ("text", "message"), [("{", "is damaged"), ('{"format": 9}', "has the format 9; expected 2")]
)
def test_a_list_that_cannot_be_read_says_so(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / contents.LIST).write_text(text)
    with pytest.raises(NoBackup, match=message):
        Contents.read(tmp_path)
    with pytest.raises(NoBackup, match="expected the folder of a backup"):
        Contents.read(tmp_path / "nothing")


@pytest.mark.django_db
def test_a_backup_of_another_database_or_of_a_later_version_is_refused(tmp_path: Path) -> None:
    listed(tmp_path / "one", vendor="oracle")
    with pytest.raises(NoBackup, match="The backup is one of oracle"):
        restore.restore(source=str(tmp_path / "one"))


def test_what_the_store_does_not_have_is_missing_and_what_is_there_is_not_copied_again(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "backup"
    name = files.manifest_name("sha256:ab")
    files.store().save(name, ContentFile(b"anno_id\n"))
    digest = backup.keep(folder, name, {})
    copy = folder / contents.FILES / name
    first = copy.stat().st_ino
    assert backup.keep(folder, name, {name: digest}) == digest
    assert copy.stat().st_ino == first
    copy.write_bytes(b"damaged")
    assert backup.keep(folder, name, {name: digest}) == digest
    assert copy.read_bytes() == b"anno_id\n"
    assert backup.keep(folder, "manifests/cd.csv", {}) == ""
