"""`tsttc new-method`: a package that trains, and passes its own test, as it is written."""

import os
import re
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


@pytest.mark.skipif(sys.platform == "win32", reason="the jobs run on Linux")
@pytest.mark.parametrize(("index", "options"), [(None, ""), ("", ""), ("ADDRESS", "--index-url ADDRESS ")])
def test_predict_takes_torch_from_the_index_that_the_job_names_and_else_from_the_usual_one(
    here: Path, index: str | None, options: str
) -> None:
    assert written("far-net").exit_code == 0
    folder, programs = here / "far-net", here / "bin"
    # In place of pip and of the command, which would fetch much: it writes down how it is called.
    copies = "".join(f'[ -e env/bin/{name} ] || cp "$0" env/bin/{name}\n' for name in ("python", "tsttc"))
    programs.mkdir()
    (programs / "python3").write_text(f'#!/bin/sh\necho "$@" >> calls\nmkdir -p env/bin\n{copies}')
    (programs / "python3").chmod(0o755)
    environment = {"PATH": f"{programs}:{os.environ['PATH']}", "FRAMES": str(here), "WEIGHTS": "predict.sh"}
    environment |= {"TSTTC_SOURCE": "WHEEL"} | ({} if index is None else {"TORCH_INDEX": index})
    subprocess.run(["./predict.sh", "out.json"], cwd=folder, env=environment, check=True)
    calls = (folder / "calls").read_text().splitlines()
    assert f"-m pip install --quiet {options}torch" in calls
    assert "-m pip install --quiet tsttc @ WHEEL ." in calls
    workflow = (folder / ".github" / "workflows" / "tsttc.yml").read_text()
    assert '${TORCH_INDEX:+--index-url "$TORCH_INDEX"} torch' in workflow


def test_no_template_names_the_host_of_a_package_index(here: Path) -> None:
    assert written("far-net").exit_code == 0
    texts = [path.read_text() for path in (here / "far-net").rglob("*") if path.is_file()]
    texts += [path.read_text() for path in (REPOSITORY / "docs").glob("*.md")]
    assert [host for text in texts for host in re.findall(r"--index-url[ =]https?:\S+", text)] == []


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
