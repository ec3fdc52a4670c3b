"""The lock files: in step with pyproject.toml, and naming no host."""

import re
import tomllib
from collections import defaultdict
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

REPOSITORY = Path(__file__).resolve().parents[2]
LOCKS = ("requirements.lock", "requirements-dev.lock")
PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())


def pins(lock: str) -> dict[str, set[Version]]:
    """Every package of a lock file with its versions (one for each range of Pythons)."""
    versions: dict[str, set[Version]] = defaultdict(set)
    for line in (REPOSITORY / lock).read_text().splitlines():
        match = re.match(r"([A-Za-z0-9._-]+)==([^ ;\\]+)", line)
        if match:
            versions[canonicalize_name(match[1])].add(Version(match[2]))
    return versions


def wanted(*, dev: bool) -> list[Requirement]:
    project, groups = PROJECT["project"], PROJECT["dependency-groups"]
    extras = project["optional-dependencies"]
    lines = [*project["dependencies"], *extras["pandas"], *groups["server"], *groups["build"]]
    return [Requirement(line) for line in (*lines, *(groups["dev"] if dev else ()))]


@pytest.mark.parametrize("lock", LOCKS)
def test_a_lock_file_names_no_host(lock: str) -> None:
    text = (REPOSITORY / lock).read_text()
    assert "://" not in text
    assert not re.search(r"^\s*--(?!hash=)", text, flags=re.MULTILINE)


@pytest.mark.parametrize(("lock", "dev"), [("requirements.lock", False), ("requirements-dev.lock", True)])
def test_a_lock_file_satisfies_pyproject(lock: str, dev: bool) -> None:
    pinned = pins(lock)
    unmet = [
        f"{requirement} (pinned: {sorted(map(str, pinned.get(canonicalize_name(requirement.name), ())))})"
        for requirement in wanted(dev=dev)
        if not pinned.get(canonicalize_name(requirement.name))
        or not all(v in requirement.specifier for v in pinned[canonicalize_name(requirement.name)])
    ]
    assert unmet == []


def test_what_an_index_shows_has_every_extra_and_no_relative_link() -> None:
    page = (REPOSITORY / PROJECT["project"]["readme"]).read_text(encoding="utf-8")
    extras = re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)
    assert set(extras) == set(PROJECT["project"]["optional-dependencies"])
    assert re.findall(r"\]\((?!https://)", page) == []


def test_both_lock_files_pin_the_same_versions() -> None:
    server, dev = pins("requirements.lock"), pins("requirements-dev.lock")
    assert {name: dev.get(name) for name in server} == dict(server)
