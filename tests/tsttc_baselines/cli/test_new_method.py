"""`tsttc new-method`: a package that trains, and passes its own test, as it is written."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from tests.evaluator.worlds import REPOSITORY
from tsttc_baselines.cli.new_method import FILES, TEMPLATES, new_method


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def written(name: str) -> Result:
    return CliRunner().invoke(new_method, [name])


def test_every_template_is_written_with_the_name(here: Path) -> None:
    result = written("far-net")
    assert result.stdout == "far-net: 11 files; far-net/README.md says how to train, run and score it.\n"
    assert set(FILES) == {path.name for path in TEMPLATES.iterdir()}
    texts = {path: path.read_text() for path in (here / "far-net").rglob("*") if path.is_file()}
    assert len(texts) == len(FILES)
    assert [path for path, text in texts.items() if "my-method" in text or "my_method" in text] == []
    project = tomllib.loads((here / "far-net" / "pyproject.toml").read_text())["project"]
    assert project["entry-points"]["tsttc.methods"] == {"far-net": "far_net.method:Net"}


@pytest.mark.parametrize("name", ["Foo", "my method", "../net", "class", "detection", "json", "there"])
def test_a_name_that_cannot_be_taken_is_refused(here: Path, name: str) -> None:
    (here / "there").mkdir()
    result = written(name)
    assert result.exit_code == 2
    assert "Invalid value for NAME" in result.stderr
    assert [path.name for path in here.iterdir()] == ["there"]


@pytest.mark.skipif(sys.platform == "win32", reason="the jobs run on Linux")
def test_predict_in_an_empty_checkout_names_what_the_job_has_to_fetch(here: Path) -> None:
    assert written("far-net").exit_code == 0

    def predict(**environment: str) -> str:
        done = subprocess.run(
            ["./predict.sh", "predictions.json"],
            cwd=here / "far-net",
            env={"PATH": os.environ["PATH"], **environment},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode != 0
        return done.stderr

    assert "TSTTC_SOURCE" in predict()
    assert "frames/val is not there" in predict(TSTTC_SOURCE="https://leaderboard.invalid/x.whl")
    present = {"TSTTC_SOURCE": "https://leaderboard.invalid/x.whl", "FRAMES": str(here)}
    assert "weights.pt is not there" in predict(**present)


@pytest.mark.torch
@pytest.mark.slow
def test_the_package_passes_its_own_test(here: Path) -> None:
    assert written("far-net").exit_code == 0
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--import-mode=importlib"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(REPOSITORY), str(here / "far-net")])}
    done = subprocess.run(
        command, cwd=here / "far-net", env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 passed" in done.stdout
