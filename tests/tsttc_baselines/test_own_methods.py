"""A method of another package: by its module from the folder one is in, or by an entry point."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.evaluator.worlds import REPOSITORY
from tests.tsttc_baselines.made_folders import made_folder

CODE = '''
from __future__ import annotations

import json
from pathlib import Path

from tsttc_baselines.estimates import Estimate


class Widths:
    """The ratio of the widths."""

    def __init__(self, *, weights: Path, power: float = 1.0) -> None:
        self.factor = float(weights.read_text())
        self.used = {"power": power or 2.0}

    def __call__(self, clip, *, frame_gap):
        widths = [clip.boxes[frame][2] - clip.boxes[frame][0] for frame in (5 - frame_gap, 5)]
        return Estimate(self.factor * (widths[0] / widths[1]) ** self.used["power"])


class Slip:
    """Three slips, which leave the method at different places."""

    def __init__(self, *, at: str) -> None:
        self.at = at
        if at == "start":
            {}["weights"]

    def __call__(self, clip, *, frame_gap):
        return 0.97 if self.at == "end" else json.loads("x")


broken = 3
'''


@pytest.fixture
def here(tmp_path: Path) -> Path:
    """A folder with a package, that is installed too, its weights, and sequences."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "__init__.py").touch()
    (tmp_path / "mine" / "net.py").write_text(CODE)
    (tmp_path / "weights.txt").write_text("1.0")
    information = tmp_path / "mine-1.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1\n")
    points = "[tsttc.methods]\nwidths = mine.net:Widths\nbad = mine.none:Net\n"
    (information / "entry_points.txt").write_text(points)
    (tmp_path / "frames").mkdir()
    made_folder(tmp_path / "frames", n=20)
    return tmp_path


def tsttc(here: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    """`tsttc baseline` in that folder."""
    return subprocess.run(
        [sys.executable, "-P", "-m", "evaluator", "baseline", *words],
        capture_output=True,
        text=True,
        check=False,
        cwd=here,
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
    )


def installed(here: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    """The same where the package is installed, from another folder."""
    environment = os.environ | {"PYTHONPATH": f"{REPOSITORY}{os.pathsep}{here}"}
    command = [sys.executable, "-P", "-m", "evaluator", "baseline", *words]
    return subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=here / "frames", env=environment
    )


def run(name: str, *options: str, out: str = "p.json") -> tuple[str, ...]:
    return ("run", name, "frames", "--out", out, "--jobs", "2", *options)


@pytest.mark.slow
def test_a_class_of_this_folder_runs_in_several_processes_and_says_what_it_was(here: Path) -> None:
    done = tsttc(here, *run("mine.net:Widths", "--set", "weights=weights.txt", "--set", "power=0"))
    assert done.returncode == 0, done.stderr
    document = json.loads((here / "p.json").read_text())
    assert set(document["predictions"].values()) == {(40 / 50) ** 2}
    meta = document["meta"]
    assert meta["parameters"] == {"weights": "weights.txt", "power": 2.0}, "what it took in place of 0"
    assert (meta["method"], meta["provenance"]) == ("mine.net:Widths", "unpublished")
    assert set(meta["weights"]) == {"weights"}
    assert meta["code"]["factory"] == "mine.net:Widths"
    (here / "mine" / "net.py").write_text(CODE + "\n")
    assert tsttc(here, *run("mine.net:Widths", "--set", "weights=weights.txt", out="q.json")).returncode == 0
    assert json.loads((here / "q.json").read_text())["meta"]["code"]["sha256"] != meta["code"]["sha256"]


@pytest.mark.slow
def test_an_installed_package_has_its_method_in_the_list(here: Path) -> None:
    listed = installed(here, "list")
    assert "widths  Widths; unpublished.\n  The ratio of the widths.\n  --set weights=PATH: " in listed.stdout
    assert (
        "The method bad cannot be loaded (ModuleNotFoundError: No module named 'mine.none')." in listed.stderr
    )
    options = ("--set", "weights=../weights.txt", "--json")
    done = installed(here, "run", "widths", ".", "--out", "../p.json", *options)
    assert json.loads(done.stdout)["parameters"] == {"weights": "weights.txt", "power": 1.0}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (run("mine.net:Widths"), "mine.net:Widths needs weights; give it with --set weights=…"),
        (
            run("mine.net:Widths", "--set", "size=3"),
            "size=3; expected NAME=VALUE, with a NAME of these: ",
        ),
        (
            run("mine.net:Widths", "--set", "power=a"),
            "Invalid value for --set power: 'a' is not a valid float",
        ),
        (run("mine.net:Widths", "--set", "weights=none.txt"), "File 'none.txt' does not exist."),
        (
            run("mine.net:Widths", "--set", "weights=frames/boxes.csv"),
            "Error: could not convert string to float: ",
        ),
        (
            run("mine.net:Slip", "--set", "at=start"),
            "The method mine.net:Slip cannot be made (KeyError: 'weights', line 28 of net.py).",
        ),
        (run("mine.net:None"), "The method mine.net:None cannot be loaded (AttributeError: "),
        (run("mine.net:broken"), "cannot be loaded (TypeError: broken is neither a class nor a Method)."),
        (run("nothing"), "There is no method 'nothing'; expected detection, pixel-mse, "),
        (run("detection", "--set", "measure=area"), "--set is for methods of yours; detection has options"),
    ],
)
def test_what_cannot_run_is_named_at_once(here: Path, words: tuple[str, ...], message: str) -> None:
    done = tsttc(here, *words)
    assert done.returncode == 2, done.stderr
    assert message in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("at", "cause"),
    [
        ("end", "TypeError (it returned a float, not an Estimate)"),
        ("call", "JSONDecodeError (Expecting value: line 1 column 1 (char 0), line 31 of net.py)"),
    ],
)
def test_a_slip_in_the_method_is_named_with_its_line(here: Path, at: str, cause: str) -> None:
    done = tsttc(here, *run("mine.net:Slip", "--set", f"at={at}"))
    assert done.returncode == 1, done.stderr
    assert f"20 of them for this reason: The method failed with {cause}; expected an estimate." in done.stderr
    assert "Traceback" not in done.stderr
