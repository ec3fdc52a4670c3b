"""What `make mutants` does, with a module of a few lines."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from tests.mutants import allowing, faults
from tests.mutants.allowing import Allowed
from tests.mutants.planting import NotPlantable, plant
from tests.services import REPOSITORY

MODULE = """\
import functools

STEPS = (1, 2, 3)


def double(function):
    @functools.wraps(function)
    def doubled(*args):
        return 2 * function(*args)

    return doubled


def is_below(a, b):
    return a < b


@double
def number():
    return 4


def rows(objects):
    return objects.filter(team=1, pk=2)


def n_steps():
    return len(STEPS)


def unasked(a):
    return a > 7


def pairs(a, b):
    return list(zip(a, b, strict=True))
"""
TESTS = """\
import tiny


def test_below() -> None:
    assert tiny.is_below(1, 2)
    assert not tiny.is_below(2, 1)


def test_number() -> None:
    assert tiny.number() == 8


def test_steps() -> None:
    assert tiny.n_steps() == 3
"""


@pytest.fixture
def tiny(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The module, imported."""
    path = tmp_path / "tiny.py"
    path.write_text(MODULE)
    spec = importlib.util.spec_from_file_location("tiny", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setitem(sys.modules, "tiny", module)
    return module


def fault_of(folder: Path, change: str) -> faults.Fault:
    return next(fault for fault in faults.of_file("tiny.py", folder) if fault.change == change)


@pytest.mark.slow
def test_changed_comparison_runs_once_it_is_planted(tiny: ModuleType, tmp_path: Path) -> None:
    assert not tiny.is_below(1, 1)
    plant(fault_of(tmp_path, "a < b -> (a) <= (b)"), root=tmp_path)
    assert tiny.is_below(1, 1)


@pytest.mark.slow
def test_dropped_decorator_is_gone_wherever_the_function_is_used(tiny: ModuleType, tmp_path: Path) -> None:
    others = {"number": tiny.number}
    plant(fault_of(tmp_path, "@double -> (nothing)"), root=tmp_path)
    assert (tiny.number(), others["number"]()) == (4, 4)


def test_changed_constant_is_read_by_its_module(tiny: ModuleType, tmp_path: Path) -> None:
    plant(fault_of(tmp_path, "(1, 2, 3) -> (1, 3)"), root=tmp_path)
    assert tiny.n_steps() == 2


def test_each_condition_of_a_query_can_be_dropped(tiny: ModuleType, tmp_path: Path) -> None:
    changes = {fault.new for fault in faults.of_file("tiny.py", tmp_path)}
    assert {"objects.filter(pk=2)", "objects.filter(team=1)"} <= changes
    assert not {"True", "False"} & changes, "equal lengths are equal also where nobody asks"


@pytest.mark.slow
def test_fault_in_a_module_that_nobody_imported_cannot_be_planted(tmp_path: Path) -> None:
    (tmp_path / "tiny.py").write_text(MODULE)
    with pytest.raises(NotPlantable):
        plant(fault_of(tmp_path, "a < b -> (a) <= (b)"), root=tmp_path)


@pytest.mark.slow
def test_run_names_what_was_noticed_what_survived_and_what_may(tmp_path: Path) -> None:
    (tmp_path / "tiny.py").write_text(MODULE)
    (tmp_path / "test_tiny.py").write_text(TESTS)
    (tmp_path / "allowed.toml").write_text(
        '[[allowed]]\nfile = "tiny.py"\nline = "return a > 7"\nchange = "7 -> 8"\nreason = "nobody asks"\n'
    )
    options = {
        "room": "tiny", "root": str(tmp_path), "sources": ["tiny.py"], "seen": str(tmp_path / "seen.json"),
        "allowed": str(tmp_path / "allowed.toml"), "seed": 1, "number": 100, "at": "",
        "seconds": 30, "jobs": 2,
    }  # fmt: skip
    words = ["-q", "-n", "0", "--capture=sys", "-p", "no:cacheprovider", "-p", "tests.mutants.inside"]
    command = [sys.executable, "-m", "pytest", "-c", str(REPOSITORY / "pyproject.toml"), *words]
    environment = os.environ | {
        "TSTTC_MUTANTS": json.dumps(options), "PYTHONPATH": f"{REPOSITORY}{os.pathsep}{tmp_path}",
    }  # fmt: skip
    ended = subprocess.run(
        [*command, f"--rootdir={tmp_path}", "test_tiny.py"],
        cwd=tmp_path, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    verdicts = {
        change: line.split()[0]
        for line in ended.stdout.splitlines()
        for change in ("4 -> 5", "a < b -> (a) <= (b)", "7 -> 8", "7 -> 6", "(1, 2, 3) -> (1, 3)")
        if f"  {change}  " in line
    }
    assert verdicts == {
        "4 -> 5": "killed", "a < b -> (a) <= (b)": "survived", "7 -> 8": "allowed", "7 -> 6": "survived",
        "(1, 2, 3) -> (1, 3)": "killed",
    }, ended.stdout + ended.stderr  # fmt: skip
    assert "tiny.py:15  a < b -> (a) <= (b)  (1 of 1 tests" in ended.stdout


def test_list_names_faults_that_can_be_planted_each_with_a_reason() -> None:
    allowed = allowing.read()
    possible = {
        (fault.path, fault.change): fault
        for path in {one.file for one in allowed}
        for fault in faults.of_file(path, REPOSITORY)
    }
    unknown = [one for one in allowed if (one.file, one.change) not in possible]
    wanting = [one for one in allowed if len(one.reason.split()) < 3 or _is_gone(one)]
    assert (unknown, wanting) == ([], [])


def _is_gone(one: Allowed) -> bool:
    return one.line not in {line.strip() for line in (REPOSITORY / one.file).read_text().splitlines()}
