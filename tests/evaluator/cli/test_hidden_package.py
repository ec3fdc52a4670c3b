"""A researcher's folder may hold a file that is called like the package."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.evaluator.worlds import REPOSITORY

pytestmark = pytest.mark.slow

EXAMPLE = REPOSITORY / "examples/baseline"


def test_a_file_called_evaluator_does_not_hide_the_package_from_the_command(tmp_path: Path) -> None:
    for name in ("evaluator", "tsttc_baselines"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('the file in this folder was imported')")
    tsttc = Path(sys.executable).with_name("tsttc")
    # Two processes estimate, so what the command starts is tested as well.
    words = ["baseline", "run", "pixel-mse", str(EXAMPLE), "--out", "p.json", "--jobs", "2"]
    completed = subprocess.run([tsttc, *words], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert completed.returncode == 0, completed.stderr
    assert len(json.loads((tmp_path / "p.json").read_text())["predictions"]) == 12
