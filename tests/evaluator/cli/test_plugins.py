"""Commands of other packages are found by their entry points; a broken one breaks nothing else."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from evaluator.cli import plugins
from tests.evaluator.worlds import Tsttc

MODULE = """
import click

@click.command(short_help="Say hello.")
def hello():
    click.echo("hello")
"""


@pytest.fixture(autouse=True)
def _empty_cache() -> Iterator[None]:
    plugins.commands.cache_clear()
    yield
    plugins.commands.cache_clear()


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An installed package with three commands; one of them works."""
    (tmp_path / "foreign_commands.py").write_text(MODULE)
    (tmp_path / "foreign_fault.py").write_text("1 / 0")
    info = tmp_path / "foreign-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: foreign\nVersion: 1.0\n")
    lines = [
        "hello = foreign_commands:hello",
        "absent = foreign_absent:hello",
        "faulty = foreign_fault:hello",
        "score = foreign_commands:hello",
    ]
    (info / "entry_points.txt").write_text("\n".join([f"[{plugins.GROUP}]", *lines, ""]))
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


def test_a_command_of_another_package_is_listed_and_runs(tsttc: Tsttc, package: Path) -> None:
    assert tsttc("hello").stdout == "hello\n"
    assert "Say hello." in tsttc("--help").stdout


def test_a_command_of_another_package_hides_none_of_the_own(tsttc: Tsttc, package: Path) -> None:
    assert "Score PREDICTIONS" in tsttc("score", "--help").stdout


@pytest.mark.parametrize(
    ("name", "cause"),
    [
        ("absent", "ModuleNotFoundError: No module named 'foreign_absent'"),
        ("faulty", "ZeroDivisionError: division by zero"),
    ],
)
def test_a_broken_command_says_what_is_broken(tsttc: Tsttc, package: Path, name: str, cause: str) -> None:
    result = tsttc(name, "--whatever", "file")
    assert result.exit_code == 2
    expected = f"Error: The command {name} of the package foreign cannot be loaded ({cause}).\n"
    assert result.stderr == expected
    assert tsttc("--help").exit_code == 0
