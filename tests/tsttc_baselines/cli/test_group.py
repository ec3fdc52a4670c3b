"""`tsttc baseline`: what every subcommand has in common."""

import re
import subprocess
import sys
from pathlib import Path

import click
import pytest

from tests.evaluator.worlds import REPOSITORY, Tsttc
from tsttc_baselines.cli import COMMANDS, baseline


def command(name: str) -> click.Command:
    subcommand = baseline.get_command(click.Context(baseline), name)
    assert subcommand is not None
    return subcommand


def test_the_group_is_loaded_by_its_entry_point(tsttc: Tsttc) -> None:
    assert re.search(
        r"^  baseline +Run the paper's baselines on frames and boxes\.", tsttc("--help").stdout, re.MULTILINE
    )
    listed = re.findall(r"^  ([a-z]+)  ", tsttc("baseline", "--help").stdout, re.MULTILINE)
    assert listed == list(COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_subcommand_explains_itself_with_an_example(tsttc: Tsttc, name: str) -> None:
    result = tsttc("baseline", name, "--help")
    assert result.exit_code == 0
    assert re.search(rf"^    tsttc baseline {name}\b", result.stdout, re.MULTILINE)


@pytest.mark.parametrize("name", COMMANDS)
def test_the_guide_lists_every_option(name: str) -> None:
    guide = (REPOSITORY / "docs" / "cli.md").read_text(encoding="utf-8").partition("\n## baseline\n")[2]
    section = guide.partition(f"\n### {name}\n")[2].partition("\n### ")[0].partition("\n## ")[0]
    flags = [flag for option in command(name).params for flag in option.opts if flag.startswith("--")]
    missing = [flag for flag in flags if f"`{flag}" not in section]
    assert not missing, f"describe them in docs/cli.md, in the section {name} of baseline"


@pytest.mark.slow
def test_help_of_every_subcommand_needs_no_opencv(tmp_path: Path) -> None:
    (tmp_path / "cv2.py").write_text("raise ImportError('there is none')")
    program = f"""
import sys; sys.path.insert(0, {str(tmp_path)!r})
from click.testing import CliRunner
from evaluator.cli import main
for words in [[], *([name] for name in {list(COMMANDS)})]:
    assert CliRunner().invoke(main, ["baseline", *words, "--help"]).exit_code == 0, words
print(*sorted(name for name in ("cv2", "numpy", "rich") if name in sys.modules))
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, cwd=REPOSITORY
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "\n"


def test_without_opencv_a_sentence_says_how_to_install_it(
    tsttc: Tsttc, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tsttc_baselines.cli.find_spec", lambda _name: None)
    result = tsttc("baseline", "run", "detection", tmp_path, "--out", tmp_path / "p.json")
    assert result.exit_code == 2
    assert result.stderr == (
        "Error: The baselines need OpenCV; install it with: pip install opencv-python-headless\n"
    )
