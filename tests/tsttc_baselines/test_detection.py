"""Detection is the ratio of boxes' sizes, and nothing else."""

import json
from pathlib import Path

import numpy as np
import pytest

from evaluator import evaluate, read_predictions, read_truth
from tsttc_baselines.boxes import Measure
from tsttc_baselines.clips import Clip
from tsttc_baselines.detection import Detection
from tsttc_baselines.estimates import Unusable
from tsttc_baselines.folders import read_folder
from tsttc_baselines.methods import get_method
from tsttc_baselines.running import run_method


def clip(reference: list[float], target: list[float]) -> Clip:
    boxes = np.full((6, 4), np.nan)
    boxes[0], boxes[5] = reference, target
    return Clip.from_frames([], boxes=boxes)


@pytest.mark.parametrize(
    ("measure", "ratio"), [("area", 0.125), ("sqrt-area", 0.125**0.5), ("height", 0.25), ("width", 0.5)]
)
def test_each_measure_is_the_size_of_the_reference_over_that_of_the_target(
    measure: Measure, ratio: float
) -> None:
    estimate = Detection(measure=measure)(clip([10, 10, 30, 20], [5, 5, 45, 45]), frame_gap=5)
    assert estimate.scale_ratio == pytest.approx(ratio, rel=1e-15)


@pytest.mark.parametrize("box", [[1, 1, 1, 9], [9, 1, 1, 9], [1, 9, 9, 1], [np.nan] * 4, [1, 1, np.inf, 9]])
def test_a_box_without_a_size_is_unusable(box: list[float]) -> None:
    for boxes in ((box, [0, 0, 8, 8]), ([0, 0, 8, 8], box)):
        with pytest.raises(Unusable, match="box has no size"):
            Detection()(clip(*boxes), frame_gap=5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("measure", "name", "protocol"),
    [
        ("area", "box-area", "toolkit"),
        ("sqrt-area", "box-sqrt-area", "tsttc-1"),
        ("height", "box-height", "tsttc-1"),
        ("height", "box-height", "toolkit"),
    ],
)
def test_real_drives_give_the_means_of_the_toolkit(
    kitti: Path, kitti_folder: Path, tmp_path: Path, measure: str, name: str, protocol: str
) -> None:
    truth = read_truth(kitti / "truth.csv")
    run_method(
        folder=read_folder(kitti_folder),
        method=get_method("detection"),
        parameters={"measure": measure},
        frame_gap=5,
        out=tmp_path / "p.json",
    )
    predictions = read_predictions((tmp_path / "p.json").read_bytes(), manifest=truth.manifest)
    scores = evaluate(predictions, truth, protocol=protocol).scores
    for range_name, expected in json.loads((kitti / "expected.json").read_text())[name].items():
        assert scores[range_name].count == expected["count"]
        assert scores[range_name].mid == pytest.approx(expected["mid"], rel=1e-9)
        assert scores[range_name].rte == pytest.approx(expected["rte"], rel=1e-9)
