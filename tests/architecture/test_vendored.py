"""Files of others in the repository are unchanged, and their origin is named."""

import hashlib
import re
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
FOLDERS = ("static/vendored", "tests/browser/vendored")
ROW = re.compile(r"^\| `([^`]+)` \| (\S.*) \|.*\| `([0-9a-f]{64})` \|$", re.MULTILINE)


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_file_of_others_is_the_one_that_its_list_names(folder: str) -> None:
    root = REPOSITORY / folder
    listed = {name: digest for name, _, digest in ROW.findall((root / "README.md").read_text())}
    digests = {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in root.iterdir()
        if path.name != "README.md"
    }
    assert digests == listed


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_file_of_others_has_its_version_and_its_licence(folder: str) -> None:
    root = REPOSITORY / folder
    for name, origin, _ in ROW.findall((root / "README.md").read_text()):
        assert re.search(r"\d+\.\d+\.\d+", origin), name
        assert name.endswith(".LICENSE") or (root / f"{name.partition('.')[0]}.LICENSE").exists(), name
