"""Files that macOS puts next to others are skipped wherever a folder is read."""

from pathlib import Path

import pytest

from evaluator import archives, read_manifest
from evaluator.hidden_files import is_hidden
from tests.evaluator.toolkit_folders import driving_folder
from tsttc_baselines.annotation.kitti import read_kitti

APPLE_DOUBLE = b"\x00\x05\x16\x07\x00\x02\x00\x00Mac OS X        "
LABEL = "0 1 Car 0 0 -1.5 10 20 30 40 1.5 1.6 3.9 1.0 1.6 20.0 0.0\n"


def add_files_of_macos(folder: Path) -> None:
    """Add what the Finder and its archives leave next to every file and folder."""
    for path in [*folder.rglob("*")]:
        if path.is_file():
            (path.parent / f"._{path.name}").write_bytes(APPLE_DOUBLE)
            beside = folder / "__MACOSX" / path.relative_to(folder).parent / f"._{path.name}"
            beside.parent.mkdir(parents=True, exist_ok=True)
            beside.write_bytes(APPLE_DOUBLE)
            (path.parent / ".DS_Store").write_bytes(b"\x00\x00\x00\x01Bud1")
    (folder / ".Trashes").mkdir()
    (folder / ".Trashes" / "old.pkl").write_bytes(b"old")


@pytest.mark.slow
def test_an_annotation_folder_of_a_mac_is_read_as_without_its_files(tmp_path: Path) -> None:
    folder = driving_folder(tmp_path / "annotations")
    digest = read_manifest(folder).digest
    add_files_of_macos(folder)
    assert read_manifest(folder).digest == digest


def test_a_folder_below_a_hidden_one_is_read(tmp_path: Path) -> None:
    folder = driving_folder(tmp_path / ".cache" / "__MACOSX" / "annotations")
    assert read_manifest(folder).n_sequences > 0


def test_kitti_labels_of_a_mac_are_read_as_without_its_files(tmp_path: Path) -> None:
    for number in range(2):
        (tmp_path / f"{number:04}.txt").write_text(LABEL)
    before = read_kitti(tmp_path)
    add_files_of_macos(tmp_path)
    assert str(read_kitti(tmp_path)) == str(before)


def test_an_archive_on_a_mac_is_whole(tmp_path: Path) -> None:
    (tmp_path / "boards").mkdir()
    (tmp_path / "boards" / "a.csv").write_bytes(b"rank\r\n")
    archives.write_list(tmp_path, site="https://example.org", made_at="2026-11-24T12:00:00+00:00")
    before = archives.check(tmp_path)
    add_files_of_macos(tmp_path)
    assert archives.check(tmp_path) == before


@pytest.mark.parametrize("name", ["._a.pkl", ".DS_Store", "__MACOSX/a.pkl", "a/.b/c.pkl", "a/__MACOSX/b/._c"])
def test_hidden_names(name: str) -> None:
    assert is_hidden(Path(name))
    assert not is_hidden(Path("a.b/c__MACOSX/d.pkl"))
