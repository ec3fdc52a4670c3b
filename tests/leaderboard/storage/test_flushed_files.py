"""A file is on the disk before `save` returns, and so is the folder that names it."""

import os
from pathlib import Path

import pytest
from django.core.files.base import ContentFile
from pytest_django import Settings

from leaderboard.storage import files
from leaderboard.storage.files import Rebuildable


@pytest.fixture
def flushed(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """What was flushed, in order, by the paths that it had then."""
    paths: list[Path] = []
    monkeypatch.setattr(os, "fsync", lambda fd: paths.append(Path(f"/proc/self/fd/{fd}").readlink()))
    return paths


def test_save_flushes_the_file_before_its_name_and_its_folder_after(
    flushed: list[Path], settings: Settings
) -> None:
    name = files.store().save("ab/cd/file.json", ContentFile(b"content"))
    target = Path(files.store().path(name))
    assert target.read_bytes() == b"content"
    content, *folders = flushed
    assert content.parent == settings.FILES_DIR / ".incoming"
    assert target.parent in folders


def test_asking_whether_a_file_is_there_flushes_the_folder_of_one_that_is(flushed: list[Path]) -> None:
    name = files.store().save("ab/file.json", ContentFile(b"content"))
    flushed.clear()
    assert not files.store().exists("ab/other.json")
    assert flushed == []
    assert files.store().exists(name)
    assert Path(files.store().path(name)).parent in flushed


def test_what_can_be_made_again_is_not_waited_for(flushed: list[Path]) -> None:
    files.store().save("ab/again.json", Rebuildable(b"content"))
    assert flushed == []
