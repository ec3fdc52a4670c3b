"""The demo's runs: kept estimates are those that the baselines make of rendered frames."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from evaluator.cli import main
from evaluator.metrics.registry import MID
from evaluator.metrics.scale import scale_ratio_to_ttc
from leaderboard.demo import runs
from leaderboard.demo.runs import FRAMES, N_SEQUENCES, RUNS
from tests.evaluator.worlds import REPOSITORY

TOLERANCE = 2e-4


@pytest.mark.slow
def test_the_commands_of_the_description_make_the_kept_estimates(tmp_path: Path) -> None:
    first, count = 14_000, 3
    part = ["--first", str(first), "--count", str(count), "--jobs", "1"]
    _call([*FRAMES.replace("frames/", str(tmp_path / "frames")).split(), *part])
    for run in RUNS:
        out = tmp_path / f"{run.name}.json"
        words = run.command.replace("frames/", str(tmp_path / "frames")).split()
        words[words.index("--out") + 1] = str(out)
        _call([*words, "--jobs", "1"])
        values = list(json.loads(out.read_text())["predictions"].values())
        np.testing.assert_allclose(values, run.kept()[first : first + count], atol=TOLERANCE)


def _call(words: list[str]) -> None:
    result = CliRunner().invoke(main, words[1:], prog_name=words[0])
    assert result.exit_code == 0, result.output


def test_every_sequence_has_an_estimate_that_can_be_submitted() -> None:
    for run in RUNS:
        kept = run.kept()
        assert kept.shape == (N_SEQUENCES,)
        assert ((kept > 0) & (kept < 10)).all()


@pytest.mark.slow
def test_methods_come_in_the_order_of_the_paper() -> None:
    ttc_s = runs.demo_split().truth.ttc_s
    errors = {
        run.name: float(np.mean(MID.errors(scale_ratio_to_ttc(run.kept(), fps_hz=2), ttc_s))) for run in RUNS
    }
    assert errors["deep-scale"] < errors["alignment"] < errors["deep-scale-head"] < errors["pixel-mse"]
    assert errors["pixel-mse"] < errors["detection-height"] < errors["detection-area"]


@pytest.mark.slow
def test_the_demo_needs_no_opencv() -> None:
    program = """
import sys; sys.modules["cv2"] = None
import django; django.setup()
from leaderboard.demo import seed
from leaderboard.demo.runs import demo_split
print(len(seed.predictions_file(seed.ENTRIES[0], truth=demo_split().truth)))
"""
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=False,
        cwd=REPOSITORY,
        env={
            "DJANGO_SETTINGS_MODULE": "leaderboard.settings",
            "PATH": "/usr/bin:/bin",
            "OPENBLAS_NUM_THREADS": "1",
        },
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 400_000
