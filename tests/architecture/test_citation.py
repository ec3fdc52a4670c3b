"""CITATION.cff is what its schema says, and names this version and the paper as boards do."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

from leaderboard import benchmark

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_the_citation_file_is_valid_and_in_step_with_the_version_and_the_paper() -> None:
    command = ["-m", "check_jsonschema", "--builtin-schema", "vendor.citation-file-format", "CITATION.cff"]
    done = subprocess.run(
        [sys.executable, *command], cwd=REPOSITORY, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    citation = yaml.safe_load((REPOSITORY / "CITATION.cff").read_text())
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    assert (citation["version"], citation["license"]) == (project["version"], project["license"])
    cited, paper = citation["preferred-citation"], benchmark.read(benchmark.DEFAULT_PATH).paper
    authors = tuple(f"{person['given-names']} {person['family-names']}" for person in cited["authors"])
    assert (cited["title"], authors, cited["year"]) == (paper.title, paper.authors, paper.year)
    assert cited["url"] == paper.url
