"""What people read uses the words of the field: no page, guide, command or message says it in ours.

`INSTEAD` is the list: a word or phrase that is kept out, and what to say instead.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.evaluator.worlds import REPOSITORY

INSTEAD = {
    "drawing recordings anew": "bootstrap over recordings",
    "scored anew": "re-scored",
    "how sure": "uncertainty, significance",
    "chance alone": "not significant",
    "may well be": "not significant",
    "take along": "export",
    "take it along": "export",
    "for ever": "permanently, forever",
    "in silence": "silently",
    "the house": "the project",
    "taken along": "exported",
    "what is said": "details",
    "what teams say": "details",
    "not said": "not specified",
    "show it to everybody": "publish",
    "to everybody": "public, visible to everyone",
    "everybody sees": "public, everyone sees",
    "nobody who": "subject, verb, object",
    "whoever": "anyone who",
    "lets nobody": "is no longer valid",
    "let nobody": "is no longer valid",
    "a closer look": "error analysis",
    "beside others": "comparison",
    "beside its neighbours": "nearby ranks",
    "beside the board": "draft edition",
    "give it up": "discard",
    "given up": "discarded",
    "found a team": "create a team",
    "found the team": "create a team",
    "team of one": "the only member",
    "make a token": "create a token",
    "the board now": "current",
    "became the board": "published",
    "as it stood": "as of",
    "taken back": "rolled back, revoked, returned to the queue",
    "standing submission": "submission that is not withdrawn",
    "stands on the board": "the board shows",
    "our fault": "system error",
    "there is nothing here": "page not found",
    "leave it as it is": "cancel",
    "mean nothing for the road": "simulated data",
}
_BANNED = re.compile(rf"\b({'|'.join(map(re.escape, INSTEAD))})\b", re.IGNORECASE)

PAGES = sorted((REPOSITORY / "templates").rglob("*.html"))
GUIDES = sorted(
    (*(REPOSITORY / "docs").rglob("*.md"), *REPOSITORY.glob("*.md"), REPOSITORY / "examples" / "README.md")
)
MESSAGES = sorted(
    path
    for room in ("evaluator", "tsttc_baselines", "leaderboard")
    for path in (REPOSITORY / room).rglob("*.py")
    if not {"migrations", "models", "api"} & set(path.parts)  # `models` and `api` have words of their own
)


def texts(path: Path) -> Iterator[tuple[int, str]]:
    """What of this file people read, by line: a page's text, a guide, the strings of a module."""
    if path.suffix != ".py":
        source = re.sub(r"\{%.*?%\}|\{\{.*?\}\}", " ", path.read_text(encoding="utf-8"))
        yield from enumerate(source.splitlines(), start=1)
        return
    tree = ast.parse(path.read_text(encoding="utf-8"))
    described = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
        if node.body and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in described:
            yield node.lineno, node.value
        elif isinstance(node, ast.FunctionDef) and "click.command" in map(_called, node.decorator_list):
            yield node.lineno, ast.get_docstring(node) or ""  # the command's help


def _called(decorator: ast.expr) -> str:
    return ast.unparse(decorator.func if isinstance(decorator, ast.Call) else decorator)


@pytest.mark.parametrize("paths", [PAGES, GUIDES, MESSAGES], ids=["pages", "guides", "messages"])
def test_people_read_the_words_of_the_field(paths: list[Path]) -> None:
    faults = [
        f"{path.relative_to(REPOSITORY)}:{line}: {word!r}; say instead: {INSTEAD[word.lower()]}"
        for path in paths
        for line, text in texts(path)
        for word in _BANNED.findall(re.sub(r"\s+", " ", text))
    ]
    assert not faults, "\n".join(faults)


def test_the_list_finds_what_it_bans() -> None:
    assert _BANNED.findall("Take it along: nobody who asks; a standing submission") == [
        "Take it along",
        "nobody who",
        "standing submission",
    ]
    assert all(text for path in (PAGES[0], GUIDES[0]) for _, text in list(texts(path))[:1])
