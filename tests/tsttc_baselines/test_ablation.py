"""Ablations: the own scores of each setting, next to what the paper prints."""

from pathlib import Path

import numpy as np
import pytest

from evaluator import GroundTruth, Rejected, read_truth
from tsttc_baselines.ablation import get_ablation, scores_of_settings
from tsttc_baselines.folders import read_folder
from tsttc_baselines.rendering.folders import write_folder
from tsttc_baselines.simulation import split

N = 8


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of few rendered sequences, with its truth."""
    folder = tmp_path_factory.mktemp("rendered")
    drawn = split(rng=np.random.default_rng(1), n_sequences=N, n_recordings=2)
    write_folder(drawn, seed=1, path=folder, rows=range(N))
    return folder


@pytest.fixture(scope="module")
def truth(rendered: Path) -> GroundTruth:
    return read_truth(rendered / "truth.csv")


@pytest.mark.slow
def test_wider_gaps_have_smaller_errors(rendered: Path, truth: GroundTruth) -> None:
    rows = scores_of_settings(get_ablation("frame-gap"), folder=read_folder(rendered), truth=truth)
    assert rows[0].scores["mid"] > rows[-1].scores["mid"]
    assert [row.published["rte"] for row in rows] == [95.7, 59.0, 42.8, 35.1, 29.9]


def test_a_gap_without_boxes_has_no_scores(rendered: Path, truth: GroundTruth, tmp_path: Path) -> None:
    for name in ("manifest.csv", "images"):
        (tmp_path / name).symlink_to(rendered / name)
    lines = (rendered / "boxes.csv").read_text().splitlines()
    kept = [line for line in lines if line.split(",")[1] in {"frame", "0", "5"}]
    (tmp_path / "boxes.csv").write_text("\n".join([*kept, ""]))
    rows = scores_of_settings(get_ablation("frame-gap"), folder=read_folder(tmp_path), truth=truth)
    assert [row.scores["mid"] is None for row in rows] == [True, True, True, True, False]
    assert rows[0].n_fallback == N


def test_a_truth_of_other_sequences_is_rejected(rendered: Path, truth: GroundTruth, tmp_path: Path) -> None:
    other = tmp_path / "truth.csv"
    other.write_text("\n".join((rendered / "truth.csv").read_text().splitlines()[:-1]) + "\n")
    with pytest.raises(Rejected, match="1 sequence is only in the ground truth or only in the folder"):
        scores_of_settings(get_ablation("bins"), folder=read_folder(rendered), truth=read_truth(other))
