"""The command is installed from a repository that a person named, never by a name that anyone may take."""

import re
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from packaging.requirements import Requirement

from tests.journeys import recipes

REPOSITORY = Path(__file__).resolve().parents[2]
RECIPES = pytest.mark.parametrize("recipe", [recipes.github(), recipes.gitlab()], ids=["github", "gitlab"])
# An argument of pip: the name alone, or with extras or a version, and no address behind it.
BARE_NAME = re.compile(r"pip install\b[^\n`]*?[ \"']tsttc(?![\w.-]|(?:\[[\w,-]*\])? @)")


def texts() -> list[Path]:
    """Everything that tells people what to type."""
    paths = [REPOSITORY / name for name in ("README.md", "PACKAGE.md", "CONTRIBUTING.md")]
    for folder, pattern in (
        ("docs", "*.md"),
        ("examples", "*"),
        ("templates", "*.html"),
        ("evaluator", "*.py"),
        ("tsttc_baselines", "*.py"),
    ):
        paths += [path for path in (REPOSITORY / folder).rglob(pattern) if path.is_file()]
    return [path for path in paths if path.suffix not in {".jpg", ".pyc"}]


def test_nothing_that_we_tell_people_to_type_installs_by_the_bare_name() -> None:
    for bad in ("pip install tsttc", "pip install -U 'tsttc[pandas]'", 'pip install "tsttc==0.1.0"'):
        assert BARE_NAME.search(bad), bad
    assert not BARE_NAME.search('pip install "tsttc @ git+https://example.org/x@1"')
    # Nobody types or copies the places where a browser may break a line.
    typed = {path: path.read_text("utf-8").replace("<wbr>", "") for path in texts()}
    bare = {path.name: match[0] for path, text in typed.items() if (match := BARE_NAME.search(text))}
    assert bare == {}


@RECIPES
def test_recipe_has_placeholders_for_repository_and_commit_that_fetch_nothing(
    recipe: recipes.Recipe,
) -> None:
    source = recipe.environment["TSTTC_SOURCE"]
    address = urlsplit(Requirement(f"tsttc @ {source}").url or "")
    assert address.scheme == "git+https"
    assert address.hostname is not None
    assert address.hostname.endswith(".example.org"), "which is reserved for examples"
    assert address.path.endswith("@COMMIT")
    assert recipe.n_installing == 1
