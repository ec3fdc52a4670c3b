"""`evaluator.lightning` in real trainings: whatever the precision, and on two devices."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from evaluator import Predictions, evaluate, read_truth
from tests.evaluator.worlds import EXAMPLES, REPOSITORY

pytestmark = pytest.mark.torch

PROGRAM = Path(__file__).with_name("lightning_training.py")


@pytest.mark.parametrize(
    ("n_devices", "precisions"), [(1, ("32-true", "bf16-true", "bf16-mixed")), (2, ("bf16-mixed",))]
)
def test_the_logged_scores_are_the_boards_and_checkpoints_follow_them(
    tmp_path: Path, n_devices: int, precisions: tuple[str, ...]
) -> None:
    command = [sys.executable, PROGRAM, tmp_path, str(n_devices), *precisions]
    environment = {"PYTHONPATH": str(REPOSITORY), "PATH": "/usr/bin:/bin", "OMP_NUM_THREADS": "1"}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "There is no score" not in done.stderr
    for precision in precisions:
        result = json.loads((tmp_path / f"{precision}.json").read_text())
        report, logged = result["report"], result["logged"]
        assert logged == pytest.approx({f"tsttc/{name}": value for name, value in report.items()}, rel=1e-6)
        assert result["best"] <= logged["tsttc/mid"]
        if precision == "32-true":
            truth = read_truth(EXAMPLES / "truth.csv")
            ttc_s = result["factor"] * truth.ttc_s
            predictions = Predictions.from_arrays(ttc_s=ttc_s, manifest=truth.manifest)
            expected = evaluate(predictions, truth).flat()
            assert report == pytest.approx(expected, rel=1e-4), "those of the last epoch"
