"""`tsttc baseline run deep-scale`."""

import hashlib
import json
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.evaluator.worlds import Tsttc
from tests.tsttc_baselines.deep_scale.made_weights import checkpoint, random_tensors
from tests.tsttc_baselines.made_folders import made_folder
from tsttc_baselines.deep_scale.weights import Use, Weights, write_weights


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "in").mkdir()
    return made_folder(tmp_path / "in")


@pytest.fixture
def weights(tmp_path: Path) -> Path:
    """Weights that answer quickly."""
    path = tmp_path / "w.npz"
    write_weights(path, Weights(random_tensors(), Use(n_cells=8, max_box_px=16.0, margin_px=4.0)))
    return path


@pytest.mark.slow
def test_a_run_names_its_weights(tsttc: Tsttc, folder: Path, weights: Path, tmp_path: Path) -> None:
    out = tmp_path / "p.json"
    result = tsttc("baseline", "run", "deep-scale", folder, "--out", out, "--weights", weights)
    assert result.exit_code == 0, result.stderr
    assert result.stderr == ""
    document = json.loads(out.read_text())
    assert document["meta"]["weights"] == {"weights": hashlib.sha256(weights.read_bytes()).hexdigest()}
    assert all(0.65 <= value <= 1.5 for value in document["predictions"].values())


def test_faulty_weights_are_refused_before_the_folder_is_read(
    tsttc: Tsttc, folder: Path, tmp_path: Path
) -> None:
    path = tmp_path / "c.pth"
    path.write_bytes(checkpoint(random_tensors())[:5000])
    result = tsttc("baseline", "run", "deep-scale", folder, "--out", tmp_path / "p.json", "--weights", path)
    assert result.exit_code == 1
    assert result.stderr.splitlines() == [
        f"Error: {path} is rejected: 1 problem",
        "  1. The file is not a complete zip; expected this project's weights or a torch checkpoint.",
    ]
    assert not (tmp_path / "p.json").exists()


@pytest.mark.skipif(find_spec("torch") is not None, reason="torch is installed")
def test_a_device_without_torch_is_refused(tsttc: Tsttc, folder: Path, weights: Path, tmp_path: Path) -> None:
    options = ["--out", tmp_path / "p.json", "--weights", weights, "--device", "cpu"]
    result = tsttc("baseline", "run", "deep-scale", folder, *options)
    assert result.exit_code == 2
    assert "--device cpu needs torch; install it with: pip install torch" in result.stderr


@pytest.mark.skipif(find_spec("torch") is not None, reason="torch is installed")
def test_training_without_torch_is_refused(tsttc: Tsttc, tmp_path: Path) -> None:
    result = tsttc("baseline", "train", "--out", tmp_path / "w.npz")
    assert result.exit_code == 2
    assert "Training needs torch; install it with: pip install torch" in result.stderr
