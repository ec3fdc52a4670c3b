"""The example folder and the notebook are what their documents say, and run as they stand."""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import Result

import evaluator
from tests.evaluator.worlds import EXAMPLES, REPOSITORY
from tsttc_baselines.clips import Image

FOLDER = EXAMPLES / "baseline"
NOTEBOOK = EXAMPLES / "starter.ipynb"
COMMAND = "tsttc baseline render examples/baseline --sequences 12 --recordings 4 --seed 4"
Tsttc = Callable[..., Result]


@pytest.mark.slow
def test_the_example_is_made_by_the_command_that_its_documents_give(tsttc: Tsttc, tmp_path: Path) -> None:
    # The commands of a folder's own page run in this folder.
    for page, command in {
        "docs/baselines.md": COMMAND,
        "examples/README.md": COMMAND.replace("examples/baseline", "baseline"),
    }.items():
        assert command in (REPOSITORY / page).read_text(encoding="utf-8"), page
    _, *arguments = COMMAND.replace("examples/baseline", str(tmp_path / "again")).split()
    done = tsttc(*arguments, "--jobs", 1)
    assert done.exit_code == 0, done.output
    files = sorted(path.relative_to(FOLDER) for path in FOLDER.rglob("*") if path.is_file())
    again = tmp_path / "again"
    assert files == sorted(path.relative_to(again) for path in again.rglob("*") if path.is_file())
    for file in files:
        if file.suffix == ".jpg":  # other releases of OpenCV encode the same image differently
            assert np.abs(image(FOLDER / file) - image(again / file).astype(float)).mean() < 1
        else:
            assert (FOLDER / file).read_text() == (again / file).read_text()


def image(path: Path) -> Image:
    return np.asarray(cv2.imread(str(path)), dtype=np.uint8)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "most_mid"), [("detection", 400), ("tracking", 15), ("pixel-mse", 20), ("alignment", 8)]
)
def test_every_method_runs_on_the_example(tsttc: Tsttc, tmp_path: Path, method: str, most_mid: float) -> None:
    file = tmp_path / "predictions.json"
    done = tsttc("baseline", "run", method, FOLDER, "--out", file, "--strict", "--jobs", 1)
    assert done.exit_code == 0, done.output
    truth = evaluator.read_truth(FOLDER / "truth.csv")
    predictions = evaluator.read_predictions(file.read_bytes(), manifest=truth.manifest)
    assert evaluator.evaluate(predictions, truth).scores["overall"].mid < most_mid


@pytest.mark.slow
def test_the_notebook_runs_from_start_to_end(tmp_path: Path) -> None:
    notebook = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    assert (notebook["nbformat"], notebook["nbformat_minor"]) == (4, 5)
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert [cell["outputs"] for cell in cells] == [[]] * len(cells), "outputs are not kept in the repository"
    shutil.copytree(FOLDER, tmp_path / "baseline")
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", "\n\n".join("".join(cell["source"]) for cell in cells)],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        env={
            "PYTHONPATH": str(REPOSITORY),
            "PYTHONIOENCODING": "utf-8",
            "OPENBLAS_NUM_THREADS": "1",
            "MPLBACKEND": "agg",
            "MPLCONFIGDIR": str(tmp_path),
        },
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("12 sequences in 4 recordings\n")
    assert "crucial 0–3 s" in done.stdout, "where the errors are"
    assert (tmp_path / "scatter.pdf").read_bytes().startswith(b"%PDF")
    assert done.stdout.endswith("mine.json has 12 sequences\n")
    manifest = evaluator.read_manifest(FOLDER / "manifest.csv")
    predictions = evaluator.read_predictions((tmp_path / "mine.json").read_bytes(), manifest=manifest)
    assert len(predictions.ttc_s) == 12
