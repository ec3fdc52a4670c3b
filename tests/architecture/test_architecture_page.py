"""docs/architecture.md says what is true: its rooms, its paths, its recipes."""

import re
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
PAGE = (REPOSITORY / "docs" / "architecture.md").read_text(encoding="utf-8")


def test_every_room_is_listed() -> None:
    rooms = {
        path.name
        for path in (REPOSITORY / "leaderboard").iterdir()
        if path.is_dir() and path.name != "__pycache__"
    }
    table = PAGE.partition("## The rooms")[2].partition("## ")[0]
    first_cells = [line.split("|")[1] for line in table.splitlines() if line.startswith("| `")]
    assert set(re.findall(r"`(\w+)/`", " ".join(first_cells))) == rooms


def test_every_path_that_the_page_names_is_there() -> None:
    paths = re.findall(r"`((?:leaderboard|evaluator|tests|docs)/[\w/]+(?:\.py)?)/?`", PAGE)
    assert len(paths) > 15
    assert [path for path in paths if not (REPOSITORY / path).exists()] == []


def test_every_recipe_is_followed_by_a_test() -> None:
    recipes = PAGE.partition("## Recipes")[2].partition("\n## ")[0].split("\n### ")[1:]
    assert len(recipes) == 3
    for recipe in recipes:
        assert re.search(r"The test `tests/[\w/]+\.py` follows this recipe", recipe), recipe
