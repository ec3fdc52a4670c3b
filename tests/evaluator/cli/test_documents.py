"""The documents show what the command prints, and name everything that it can do."""

from __future__ import annotations

import re
from pathlib import Path

import click
import pytest

from evaluator.cli import EPILOG, own_commands
from evaluator.cli.exits import MEANINGS, Exit
from evaluator.cli.gates import OPERATORS
from evaluator.metrics.protocol import SCORE_NAMES
from tests.evaluator.cli.console import DOCUMENTS, REPOSITORY, documented_shell, recorded

GUIDE = REPOSITORY / "docs" / "cli.md"
IN_COMMON = "What the commands have in common"
# The table in this section has them for all commands, but some commands have their own --timeout.
SHARED = {"--server", "--url", "--timeout"}


@pytest.mark.slow
@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.relative_to(REPOSITORY).as_posix())
def test_examples_show_what_the_command_prints(document: Path) -> None:
    text = document.read_text()
    assert text.count("```console") >= 3
    with documented_shell() as run:
        assert steady(recorded(text, run)) == steady(text)


def steady(text: str) -> str:
    """`text` without the last digits of long numbers, in which processors differ."""
    return re.sub(r"\d+\.\d{9,}", lambda number: f"{float(number[0]):.9g}", text)


def options() -> list[tuple[str, str]]:
    return [
        (name, flag)
        for name, command in own_commands().items()
        for parameter in command.params
        if isinstance(parameter, click.Option)
        for flag in parameter.opts
    ]


def section(heading: str) -> str:
    return GUIDE.read_text().partition(f"\n## {heading}\n")[2].partition("\n## ")[0]


def test_guide_lists_every_exit_code_with_its_meaning() -> None:
    listed = re.findall(r"^\| (\d+) \| (.*) \|$", section(IN_COMMON).replace("`", ""), re.MULTILINE)
    assert listed == [(str(code.value), meaning) for code, meaning in MEANINGS.items()]
    assert set(MEANINGS) == set(Exit)
    assert all(f"{code.value:>3}  {meaning}" in EPILOG for code, meaning in MEANINGS.items())


def test_documents_for_scripts_name_the_code_of_a_file_that_is_not_confirmed() -> None:
    readme = (REPOSITORY / "README.md").read_text().partition("Exit codes say what failed:")[2]
    codes = re.findall(r"(?:^|, )(\d+) ", readme.partition(" Read on")[0].strip())
    assert codes == [str(code.value) for code in Exit if code < Exit.INTERRUPTED]
    for name in ("docs/ci.md", "docs/researchers.md", "docs/faq.md", "examples/ci/gitlab-ci.yml"):
        text = (REPOSITORY / name).read_text()
        assert re.search(rf"(?:code|With)s? {Exit.UNCONFIRMED.value}\b", text), name


def test_guide_names_every_score_and_operator_of_a_gate() -> None:
    gate = GUIDE.read_text().partition("**A gate sets the exit code**")[2].partition("\n## ")[0]
    assert [name for name in (*SCORE_NAMES, *OPERATORS) if f"`{name}`" not in gate] == []


@pytest.mark.parametrize("command", own_commands())
def test_guide_has_a_section_for_every_command(command: str) -> None:
    assert f"\n## {command}\n" in GUIDE.read_text()


@pytest.mark.parametrize(("command", "flag"), options())
def test_guide_names_every_option_of_every_command(command: str, flag: str) -> None:
    assert f"`{flag}" in section(command) + (section(IN_COMMON) if flag in SHARED else "")
