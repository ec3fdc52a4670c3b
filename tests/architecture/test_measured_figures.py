"""Each section of the guides on uncertainty with a measured figure names the command that prints it."""

import re
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.services import REPOSITORY
from tests.validity.__main__ import TABLES

GUIDES = ("uncertainty", "validation")
# Code, links' addresses and formulas have no measured figures.
OTHER = re.compile(r"```.*?```|\$`.*?`\$|`[^`\n]*`|\]\([^)]*\)", re.DOTALL)
# A per cent, a decimal number, or a row of a table with numbers.
FIGURE = re.compile(r"\d+(?:\.\d+)?(?:&nbsp;|\s)?%|\d+\.\d+|^\|.*\|\s*\**\d[\d.]*\**\s*\|", re.MULTILINE)
# What is meant, not measured: levels of tests and intervals, bounds of p, shares of a distribution.
NOMINAL = re.compile(
    r"\b(?:95|5|97\.5|2\.5|80)(?:&nbsp;|\s)?%|[<≤≥=](?:&nbsp;|\s)?0\.\d+|0\.001, 0\.01 and 0\.05|with 0\.05"
)
# Sections whose figures are no measurements, and why.
EXCEPTIONS = {
    ("uncertainty", "Rank ranges"): "an example of values and of rounding",
}
COMMAND = re.compile(r"`(?:python -m (?P<module>[\w.]+)(?P<options>[^`]*)|make (?P<target>\w+))`")


def sections(guide: str) -> Iterator[tuple[str, str]]:
    """Headings of a guide with the text below each, up to the next heading."""
    text = (REPOSITORY / "docs" / f"{guide}.md").read_text(encoding="utf-8")
    heading = "the beginning"
    for part in re.split(r"^(#+ .*)$", text, flags=re.MULTILINE):
        if part.startswith("#"):
            heading = part.lstrip("# ")
        else:
            yield heading, part


def figures(text: str) -> list[str]:
    """The measured figures of a text."""
    return [match.strip() for match in FIGURE.findall(NOMINAL.sub("", OTHER.sub("", text)))]


def source_of(module: str) -> str:
    """The source that `python -m` runs."""
    spec = find_spec(module)
    if spec and spec.submodule_search_locations:
        spec = find_spec(f"{module}.__main__")
    return Path(spec.origin).read_text(encoding="utf-8") if spec and spec.origin else ""


@pytest.mark.parametrize("guide", GUIDES)
def test_every_section_with_a_measured_figure_names_the_command_that_prints_it(guide: str) -> None:
    nameless = {
        heading: measured
        for heading, text in sections(guide)
        if (measured := figures(text)) and not COMMAND.search(text) and (guide, heading) not in EXCEPTIONS
    }
    assert nameless == {}


def test_every_exception_is_a_section_with_figures_and_without_a_command() -> None:
    texts = {(guide, heading): text for guide in GUIDES for heading, text in sections(guide)}
    assert [each for each in EXCEPTIONS if not figures(texts[each]) or COMMAND.search(texts[each])] == []


@pytest.mark.parametrize("guide", GUIDES)
def test_every_command_that_a_guide_names_can_be_run(guide: str) -> None:
    targets = set(re.findall(r"^([a-z-]+):.* ## ", (REPOSITORY / "Makefile").read_text(), re.MULTILINE))
    commands = [match for _, text in sections(guide) for match in COMMAND.finditer(text)]
    assert len(commands) > 5
    for command in commands:
        if command["target"]:
            assert command["target"] in targets, command[0]
            continue
        assert '__name__ == "__main__"' in source_of(command["module"]), command[0]
        if command["module"] == "tests.validity":
            assert set(command["options"].split()) <= set(TABLES), command[0]


def test_every_table_of_the_simulations_is_named_in_a_guide() -> None:
    named = {
        name
        for guide in GUIDES
        for _, text in sections(guide)
        for command in COMMAND.finditer(text)
        if command["module"] == "tests.validity"
        for name in command["options"].split()
    }
    assert named == set(TABLES)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("It holds in 92.4% of cases.", ["92.4%"]),
        ("called different in 13&nbsp;% and 37 %", ["13&nbsp;%", "37 %"]),
        ("| exponential | 92 | 93 |", ["| exponential | 92 | 93 |"]),
        ("with 95% confidence, p < 0.05, `0.5`, [5.1](x#0.7)", ["5.1"]),
        ("no number at all", []),
    ],
)
def test_a_measured_figure_is_a_per_cent_a_decimal_or_a_cell(text: str, expected: list[str]) -> None:
    assert figures(text) == expected
