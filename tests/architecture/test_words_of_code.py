"""Identifiers and docstrings use the trade's nouns: a person who knows Django reads the code without a key.

`IDENTIFIERS` keeps words out of names, `DOCSTRINGS` out of first paragraphs of docstrings; each has a reason.
A name is split at underscores and capitals: `found_rows` and `FoundRows` both have the word `found`.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.evaluator.worlds import REPOSITORY

ROOTS = ("evaluator", "leaderboard", "tsttc_baselines", "tests", "benchmarks")
IDENTIFIERS = {
    "found": "a pronoun: name the thing that was found, as `split`, `row`, `match`",
    "told": "a pronoun with seven meanings: `flash_message`, `reason`, `answer`, `line`",
    "held": "four meanings: `readable_truths`, `leased_row`, `locked`, `clamped`",
    "said": "a pronoun: `output`, `answer`, `message`",
    "whoever": "a pronoun: `user`, `reader`, `caller`",
    "somebody": "a pronoun: `user`, `person`",
    "anew": "dialect: `again`, `renewed`",
    "standing": "dialect: `active`",
    "deed": "dialect: `action`",
    "deeds": "dialect: `actions`",
    "findable": "dialect: `search_index`",
    "claimable": "dialect: `queries`",
    "patience": "dialect: `TIMEOUT_S`, `GIVE_UP_AFTER`, `retry_policy`",
    "place": "six meanings: `sort_key`, `position`, `row`, `range_css`, `pointer`",
    "places": "as `place`",
}
DOCSTRINGS = {
    "anew": "again",
    "whoever": "anyone who; or name the caller",
    "somebody": "a person, a user",
    "so many": "n, at most n",
    "of which": "split the sentence",
    "is told": "gets, sees",
    "are told": "get, see",
    "lets nobody": "prevents",
    "let nobody": "prevent",
    "nobody else": "no other process",
    "stands": "is",
    "beside": "next to, with",
    "goes on": "continues",
    "in earnest": "really",
    "afresh": "again",
}


def modules() -> list[Path]:
    """Every module that a person writes."""
    paths = (path for root in ROOTS for path in (REPOSITORY / root).rglob("*.py"))
    return sorted(path for path in paths if "migrations" not in path.parts)


def words(name: str) -> set[str]:
    """The words of an identifier, in small letters."""
    return set(re.findall(r"[a-z]+", re.sub(r"([A-Z]+)", r"_\1", name).lower()))


def names(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """What a module names: variables, arguments, functions, classes, attributes that it sets."""
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
                yield node.lineno, name
            case ast.arg(arg=name) | ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                yield node.lineno, name


def first_lines(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """The first paragraph of each docstring."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node):
            yield node.body[0].lineno, re.sub(r"\s+", " ", str(ast.get_docstring(node)).partition("\n\n")[0])


def faults(path: Path) -> Iterator[str]:
    """Each word of a module that is on one of the lists, with what to say instead."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    where = path.relative_to(REPOSITORY)
    for line, name in names(tree):
        for word in sorted(words(name) & IDENTIFIERS.keys()):
            yield f"{where}:{line}: `{name}`: {word!r} is {IDENTIFIERS[word]}"
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and node.name == "of":
            yield f"{where}:{node.lineno}: `of` names no function: `module.of(…)` hides what it returns"
    for line, text in first_lines(tree):
        for phrase, instead in DOCSTRINGS.items():
            if re.search(rf"\b{phrase}\b", text, re.IGNORECASE):
                yield f"{where}:{line}: {phrase!r} in a docstring; say instead: {instead}"


@pytest.mark.parametrize("root", ROOTS)
def test_code_uses_the_words_of_the_trade(root: str) -> None:
    paths = [path for path in modules() if path.relative_to(REPOSITORY).parts[0] == root]
    assert paths
    lines = [fault for path in paths for fault in faults(path)]
    assert not lines, "\n".join(lines)


def test_the_lists_see_names_and_docstrings() -> None:
    code = 'def told_apart(found):\n    """Whoever asks."""\n    class FoundRows:\n        HELD = 1\n'
    tree = ast.parse(code)
    assert {word for _, name in names(tree) for word in words(name)} >= {"told", "found", "held"}
    assert [text for _, text in first_lines(tree)] == ["Whoever asks."]
