"""What a researcher gets from `pip install .`: evaluator, baselines and their command; no web framework."""

import re
import shutil
import subprocess
import sys
import venv
from collections.abc import Iterator
from pathlib import Path
from zipfile import ZipFile

import pytest

from tests.evaluator.cli.console import EXAMPLES, recorded, shell
from tests.services import ServiceMissing, skip_or_fail

pytestmark = pytest.mark.slow

REPOSITORY = Path(__file__).resolve().parents[2]
# pip's words for an index that cannot be reached.
NO_INDEX = ("Could not find a version", "No matching distribution", "Connection", "Temporary failure in name")


def pip(*arguments: object) -> None:
    """Run this environment's pip; an index out of reach is a missing service, anything else an error."""
    options = ("--disable-pip-version-check", "--quiet", "--retries=10")  # of connections; the delays grow
    done = subprocess.run(
        [sys.executable, "-m", "pip", *options, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode and any(words in done.stderr for words in NO_INDEX):
        skip_or_fail(ServiceMissing(f"pip cannot reach a package index: {done.stderr.splitlines()[-1]}"))
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from a copy so that the checkout stays clean."""
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    for name in ("pyproject.toml", "PACKAGE.md", "LICENSE"):
        shutil.copy(REPOSITORY / name, source)
    for name in ("evaluator", "tsttc_baselines", "leaderboard"):
        shutil.copytree(REPOSITORY / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    # With the pinned setuptools, as `make` installs: nothing is fetched.
    pip("wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", out, source)
    (built,) = out.glob("tsttc-*.whl")
    return built


@pytest.fixture(scope="module")
def environment(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The programs of an environment that had nothing before the wheel; versions as in the lock file."""
    home = tmp_path_factory.mktemp("environment")
    venv.create(home, symlinks=True)
    lock = (REPOSITORY / "requirements.lock").read_text()
    versions = home / "constraints.txt"
    # Without hashes: with them pip would ask for one of the wheel itself, which was built a moment ago.
    versions.write_text(re.sub(r" *\\\n +--hash=\S+", "", lock))
    pip("--python", home / "bin" / "python", "install", "--no-compile", "--constraint", versions, wheel)
    yield home / "bin"
    shutil.rmtree(home)


def test_wheel_holds_evaluator_and_baselines_alone(wheel: Path) -> None:
    with ZipFile(wheel) as archive:
        names = archive.namelist()
    tops = {name.partition("/")[0] for name in names}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"evaluator", "tsttc_baselines"}
    assert {
        "evaluator/py.typed",
        "tsttc_baselines/py.typed",
        "evaluator/cli/__init__.py",
        "evaluator/client/api.py",
    } <= set(names)
    present = {
        path.relative_to(REPOSITORY).as_posix()
        for folder in ("evaluator", "tsttc_baselines")
        for pattern in ("*.py", "new_method/*.txt")
        for path in (REPOSITORY / folder).rglob(pattern)
    }
    assert present <= set(names), "every module of the two is in the wheel, and every template"


def test_environment_has_no_web_framework(environment: Path) -> None:
    listed = subprocess.run(
        [sys.executable, "-m", "pip", "--python", environment / "python", "list", "--format=freeze"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.lower()
    assert "tsttc==" in listed
    assert not re.search(r"^(django|celery|redis|psycopg|pandas)", listed, re.MULTILINE)


def test_installed_command_prints_its_version_and_what_the_examples_show(environment: Path) -> None:
    text = (EXAMPLES / "README.md").read_text()
    with shell([str(environment / "tsttc")], {}) as run:
        assert run("tsttc --version") == f"tsttc {version_of(environment)}\n"
        assert recorded(text, run) == text


def version_of(environment: Path) -> str:
    return subprocess.run(
        [environment / "python", "-c", "import importlib.metadata as m; print(m.version('tsttc'))"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
