"""The programs of examples/ and the lines of the page about Python run as they stand."""

from __future__ import annotations

import hashlib
import re
import shutil
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import click
import pytest

from evaluator import TTC_RANGES, evaluate, read_predictions, read_truth
from evaluator.cli import own_commands
from evaluator.cli.exits import Exit
from tests.evaluator.worlds import EXAMPLES, REPOSITORY
from tsttc_baselines.methods import OWN_WEIGHTS

PROGRAMS = sorted(EXAMPLES.glob("*.py"))
PAGE = (REPOSITORY / "docs" / "ci.md").read_text(encoding="utf-8")
PYTHON, MODELS = (
    (REPOSITORY / "docs" / name).read_text(encoding="utf-8") for name in ("python.md", "models.md")
)


def printed(program: Path, folder: Path) -> list[str]:
    """The lines that a program prints when run in another folder than its own; warnings are errors."""
    return subprocess.run(
        [sys.executable, "-W", "error", program],
        capture_output=True,
        text=True,
        check=True,
        cwd=folder,
        env={"PYTHONPATH": str(REPOSITORY), "PYTHONIOENCODING": "utf-8"},
    ).stdout.splitlines()


def test_arrays_come_straight_to_a_report(tmp_path: Path) -> None:
    lines = printed(EXAMPLES / "from_arrays.py", tmp_path)
    assert re.fullmatch(r"MiD \d+\.\d\d, crucial \d+\.\d\d", lines[0])
    assert lines[1].endswith("of 60 sequences")


@pytest.mark.slow
def test_a_frame_comes_straight_to_a_report(tmp_path: Path) -> None:
    values = dict(line.split() for line in printed(EXAMPLES / "from_frame.py", tmp_path))
    assert len(values) == 2 * (1 + len(TTC_RANGES))
    assert values["rte_crucial"] == "5.00", "five percent too long, where nothing is truncated"


@pytest.mark.slow
def test_ratios_at_every_gap_score_the_same(tmp_path: Path) -> None:
    lines = printed(EXAMPLES / "from_scale_ratios.py", tmp_path)
    assert len(lines) == 5
    assert len({line.partition(": ")[2] for line in lines}) == 1


@pytest.mark.slow
def test_toolkit_s_result_file_is_taken_as_it_is(tmp_path: Path) -> None:
    truth = read_truth(EXAMPLES / "truth.csv")
    predictions = read_predictions((EXAMPLES / "predictions.json").read_bytes(), manifest=truth.manifest)
    expected = [
        f"{name}: MiD {report.scores['overall'].mid:.2f}, RTE {report.scores['overall'].rte:.2f}%"
        for name in ("toolkit", "tsttc-1")
        for report in [evaluate(predictions, truth, protocol=name)]
    ]
    assert printed(EXAMPLES / "toolkit_results.py", tmp_path) == expected


@pytest.mark.slow
def test_better_model_is_better_by_more_than_chance(tmp_path: Path) -> None:
    lines = printed(EXAMPLES / "intervals.py", tmp_path)
    assert re.fullmatch(r"MiD of the new one: \d+\.\d \[\d+\.\d, \d+\.\d\]", lines[0])
    assert lines[1].startswith("new − old: -")
    assert float(lines[1].rpartition("p = ")[2]) < 0.05


@pytest.mark.slow
def test_a_training_loop_gets_better_and_ends_with_a_file(tmp_path: Path) -> None:
    *epochs, worst, last = printed(EXAMPLES / "training_loop.py", tmp_path)
    mid_by_epoch = [float(line.partition("MiD ")[2].partition(",")[0]) for line in epochs]
    assert mid_by_epoch == sorted(mid_by_epoch, reverse=True)
    assert last.startswith(f"best MiD {mid_by_epoch[-1]:.2f}; ")
    name, _, mid = worst.removeprefix("worst recording ").partition(": MiD ")
    assert name in read_truth(EXAMPLES / "truth.csv").manifest.bag_stamp
    assert float(mid.partition(" ")[0]) >= mid_by_epoch[-1]


def test_every_program_is_named_where_the_examples_are_and_on_the_page() -> None:
    for text in (PYTHON, (EXAMPLES / "README.md").read_text(encoding="utf-8")):
        assert [path.name for path in PROGRAMS if f"`{path.name}`" not in text] == []


@pytest.mark.slow
def test_lines_of_the_pages_about_python_and_models_run_in_a_copy_of_the_examples(tmp_path: Path) -> None:
    shutil.copytree(EXAMPLES, tmp_path / "examples")
    program = tmp_path / "page.py"
    program.write_text(
        "\n".join(re.findall(r"```python\n(.*?)```", PYTHON + MODELS, re.DOTALL)), encoding="utf-8"
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", program],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path / "examples",
        env={"PYTHONPATH": str(REPOSITORY), "PYTHONIOENCODING": "utf-8"},
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "nan /30 The value is NaN" in done.stdout
    assert hashlib.sha256(OWN_WEIGHTS.read_bytes()).hexdigest() in MODELS


def parts_of(command: click.Command) -> list[click.Command]:
    """The commands of a group, or the command itself."""
    if not isinstance(command, click.Group):
        return [command]
    context = click.Context(command)
    parts = (command.get_command(context, name) for name in command.list_commands(context))
    return [part for part in parts if part is not None]


def test_page_names_commands_options_and_exit_codes_that_there_are() -> None:
    shown = re.findall(r"`tsttc ([a-z-]+)|^tsttc ([a-z-]+)", PAGE, re.MULTILINE)
    others = {entry.name: entry.load() for entry in entry_points(group="tsttc.commands")}
    assert {first or second for first, second in shown} <= own_commands().keys() | others.keys()
    commands = [
        *own_commands().values(),
        *(each for command in others.values() for each in parts_of(command)),
    ]
    known = {flag for command in commands for option in command.params for flag in option.opts}
    of_curl_and_gh = {"--fail-with-body", "--form-string", "--proto", "--pattern"}
    assert set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", PAGE)) - of_curl_and_gh <= known
    codes = {int(code) for code in re.findall(r"[Cc]ode (\d)", PAGE)}
    assert codes <= {code.value for code in Exit}
