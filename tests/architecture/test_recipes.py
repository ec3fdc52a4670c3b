"""The command is installed from a repository that somebody named, never by a name that anybody may take."""

import importlib.util
import os
import re
import shutil
import subprocess
import venv
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from packaging.requirements import Requirement

from tests.architecture.test_wheel import NO_INDEX
from tests.journeys import recipes
from tests.services import ServiceMissing, skip_or_fail

REPOSITORY = Path(__file__).resolve().parents[2]
RECIPES = pytest.mark.parametrize("recipe", [recipes.github(), recipes.gitlab()], ids=["github", "gitlab"])
# An argument of pip: the name alone, or with extras or a version, and no address behind it.
BARE_NAME = re.compile(r"pip install\b[^\n`]*?[ \"']tsttc(?![\w.-]|(?:\[[\w,-]*\])? @)")


def texts() -> list[Path]:
    """Everything that tells people what to type."""
    found = [REPOSITORY / "README.md", REPOSITORY / "CONTRIBUTING.md"]
    for folder, pattern in (
        ("docs", "*.md"),
        ("examples", "*"),
        ("templates", "*.html"),
        ("evaluator", "*.py"),
        ("baselines", "*.py"),
    ):
        found += [path for path in (REPOSITORY / folder).rglob(pattern) if path.is_file()]
    return [path for path in found if path.suffix not in {".jpg", ".pyc"}]


def test_nothing_that_we_tell_people_to_type_installs_by_the_bare_name() -> None:
    for bad in ("pip install tsttc", "pip install -U 'tsttc[frames]'", 'pip install "tsttc==0.1.0"'):
        assert BARE_NAME.search(bad), bad
    assert not BARE_NAME.search('pip install "tsttc @ git+https://example.org/x@1"')
    bare = {path.name: found[0] for path in texts() if (found := BARE_NAME.search(path.read_text("utf-8")))}
    assert bare == {}


@RECIPES
def test_recipe_has_a_place_for_repository_and_commit_that_fetches_nothing_as_it_stands(
    recipe: recipes.Recipe,
) -> None:
    source = recipe.environment["TSTTC_SOURCE"]
    address = urlsplit(Requirement(f"tsttc @ {source}").url or "")
    assert address.scheme == "git+https"
    assert address.hostname is not None
    assert address.hostname.endswith(".example.org"), "which is reserved for examples"
    assert address.path.endswith("@COMMIT")
    assert recipe.n_installing == 1


@pytest.mark.slow
def test_recipe_installs_the_commit_that_it_names(tmp_path: Path) -> None:
    source, target = tmp_path / "source", tmp_path / "target"
    source.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(REPOSITORY / name, source)
    for name in ("evaluator", "leaderboard"):
        shutil.copytree(REPOSITORY / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    commit = committed(source)
    (source / "evaluator" / "__init__.py").write_text("raise SystemExit('a later commit')")
    committed(source)
    venv.create(target, symlinks=True)
    lend_pip(target)
    placed = recipes.github().environment["TSTTC_SOURCE"]
    surroundings = os.environ | {
        "TSTTC_SOURCE": placed.replace("COMMIT", commit),
        # Git finds what the recipe names in this folder.
        "GIT_CONFIG_COUNT": "1",
        "GIT_CONFIG_KEY_0": f"url.file://{source}.insteadOf",
        "GIT_CONFIG_VALUE_0": placed.removeprefix("git+").partition("@")[0],
        "PATH": f"{target / 'bin'}:{os.environ['PATH']}",
        "PIP_NO_DEPS": "1",
        "PIP_NO_COMPILE": "1",
        "PIP_DISABLE_PIP_VERSION_CHECK": "1",
    }
    done = subprocess.run(
        ["bash", "-c", recipes.INSTALL], env=surroundings, capture_output=True, text=True, check=False
    )
    if done.returncode and any(words in done.stderr for words in NO_INDEX):
        skip_or_fail(ServiceMissing(f"pip cannot reach a package index: {done.stderr.splitlines()[-1]}"))
    assert done.returncode == 0, done.stderr
    (installed,) = target.glob("lib/*/site-packages/evaluator/__init__.py")
    assert "a later commit" not in installed.read_text()
    assert (target / "bin" / "tsttc").is_file()


def lend_pip(environment: Path) -> None:
    """Put this environment's pip there, which takes seconds to be installed."""
    pip = importlib.util.find_spec("pip")
    assert pip is not None
    assert pip.origin is not None
    (packages,) = environment.glob("lib/*/site-packages")
    (packages / "pip").symlink_to(Path(pip.origin).parent)


def committed(folder: Path) -> str:
    """The id of a commit of everything in the folder, a repository of its own."""
    own = ["-c", "user.name=x", "-c", "user.email=x@example.org", "-c", "commit.gpgsign=false"]
    for arguments in (["init", "-q"], ["add", "-A"], [*own, "commit", "-q", "-m", "x"]):
        subprocess.run(["git", *arguments], cwd=folder, check=True)
    return subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=folder, check=True, capture_output=True, text=True
    ).stdout.strip()
