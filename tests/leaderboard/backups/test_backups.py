"""A backup says what it is, refuses what would do harm, and comes back whole or not at all."""

import re
from pathlib import Path

import pytest
from django.conf import settings as configured
from django.core.files.base import ContentFile
from django.core.management import CommandError, call_command
from django.utils import timezone

from leaderboard.backups import contents, copies, restore
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
            "database": "database-1/leaderboard.sqlite3",
            "database_sha256": "",
            "files": {FILE: contents.digest_at(kept)},
            "ground_truth": {},
            "faults": {},
            "keys": {"keys": []},
            "boards": {},
            "audit": "0" * 64,
            **changed,
        }
    )
    made.write(folder)
    return made


def test_a_folder_of_the_sites_own_is_refused(tmp_path: Path) -> None:
    for folder in ("/", str(tmp_path), str(configured.FILES_DIR), str(configured.GROUND_TRUTH_DIR / "x")):
        with pytest.raises(NoBackup, match="lie in each other"):
            contents.folder_of(folder)


def test_a_damaged_backup_is_not_restored(tmp_path: Path) -> None:
    folder = tmp_path / "backup"
    listed(folder)
    (folder / contents.FILES / FILE).write_bytes(b"[]")
    with pytest.raises(CommandError, match=r"damaged; nothing was changed. 1 of 2 files[^$]*predictions/ab"):
        call_command("restore", str(folder))
    assert not configured.FILES_DIR.exists()


@pytest.mark.parametrize("name", ["../evil.py", "/tmp/evil.py", "sub/../../evil.py", "..", ".", "", "a\0b"])
@pytest.mark.parametrize("entry", ["database", "ground_truth", "files"])
def test_a_name_that_leads_out_of_its_directory_is_refused_before_anything_is_written(
    entry: str, name: str, tmp_path: Path
) -> None:
    listed(tmp_path / "backup", **{entry: name if entry == "database" else {name: "0" * 64}})
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(CommandError, match=re.escape(f"names {name!r}; expected a name inside")):
        call_command("restore", str(tmp_path / "backup"))
    assert sorted(tmp_path.rglob("*")) == before


def test_a_folder_without_a_sound_list_is_no_backup(tmp_path: Path) -> None:
    with pytest.raises(NoBackup, match="expected the folder of a backup"):
        Contents.read(tmp_path)
    (tmp_path / contents.LIST).write_text("{")
    with pytest.raises(NoBackup, match="is damaged"):
        Contents.read(tmp_path)


@pytest.mark.django_db
def test_a_backup_of_another_database_or_of_a_later_version_is_refused(tmp_path: Path) -> None:
    listed(tmp_path / "one", vendor="oracle")
    with pytest.raises(NoBackup, match="The backup is one of oracle"):
        restore.restore(source=str(tmp_path / "one"), now=timezone.now())


def test_what_is_there_is_not_copied_again(tmp_path: Path) -> None:
    name = files.predictions_name(files.measure(ContentFile(b"{}")).digest)
    files.store().save(name, ContentFile(b"{}"))
    reader = copies.StoreReader()
    first = copies.keep_stored(tmp_path, name, former="", reader=reader)
    number = (tmp_path / contents.FILES / name).stat().st_ino
    assert copies.keep_stored(tmp_path, name, former="", reader=reader) == first
    assert (tmp_path / contents.FILES / name).stat().st_ino == number
