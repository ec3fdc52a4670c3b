"""A backup says what it is, refuses what would do harm, and comes back whole or not at all."""

from pathlib import Path

import pytest
from django.conf import settings as configured
from django.core.files.base import ContentFile
from django.core.management import CommandError, call_command

from leaderboard.backups import backup, contents, restore
from leaderboard.backups.contents import Contents, NoBackup
from leaderboard.storage import files


def listed(folder: Path, **changed: object) -> Contents:
    """A backup of one file, without rows."""
    kept = folder / contents.FILES / "predictions" / "ab.json"
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
            "files": {"predictions/ab.json": contents.digest_at(kept)},
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
    (folder / contents.FILES / "predictions" / "ab.json").write_bytes(b"[]")
    with pytest.raises(CommandError, match=r"damaged; nothing was changed. 1 of 1 files[^$]*predictions/ab"):
        call_command("restore", str(folder))
    assert not configured.FILES_DIR.exists()


@pytest.mark.parametrize(
    ("text", "message"), [("{", "is damaged"), ('{"format": 9}', "has the format 9; expected 1")]
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
