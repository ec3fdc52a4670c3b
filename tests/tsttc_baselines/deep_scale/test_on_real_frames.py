"""The toolkit's weights: golden values of their parts, and their errors on real frames."""

import csv
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from evaluator import scale_ratio_to_ttc
from evaluator.metrics.registry import MID, RTE
from tests.services import shared_data
from tsttc_baselines.clips import Clip, Image
from tsttc_baselines.deep_scale.estimator import DeepScale
from tsttc_baselines.deep_scale.layers import NumpyLayers
from tsttc_baselines.deep_scale.network import Array, Sampling, features, similarities
from tsttc_baselines.deep_scale.roi_align import sampling_matrix
from tsttc_baselines.deep_scale.weights import read_weights


@pytest.fixture(scope="module")
def shared() -> Path:
    """The folder of shared data with the toolkit's weights."""
    folder = shared_data()
    if folder is None or not (folder / "deep-scale" / "Deep_TTC.pth").is_file():
        pytest.skip(
            "deep-scale is not here: TSTTC_SHARED_DATA names no folder that has the toolkit's weights"
        )
    return folder


@pytest.fixture(scope="module")
def golden(shared: Path) -> Any:
    return json.loads((shared / "deep-scale" / "golden.json").read_text())


@pytest.fixture(scope="module")
def layers(shared: Path) -> NumpyLayers:
    return NumpyLayers(read_weights(shared / "deep-scale" / "Deep_TTC.pth").tensors)


def of_noise(layers: NumpyLayers, seed: int) -> Array:
    """The features of the golden image with this seed, (1, 24, 64, 80)."""
    image = (np.random.default_rng(seed).random((3, 64, 80)) * 255).astype(np.float32)
    return features(layers, image[np.newaxis])


def test_the_backbone_gives_the_golden_features(layers: NumpyLayers, golden: Any) -> None:
    activations = of_noise(layers, 0)[0]
    for each in golden["backbone"]["values"]:
        assert activations[tuple(each["at"])] == pytest.approx(each["value"], abs=1e-4)
    assert activations.mean() == pytest.approx(golden["backbone"]["mean"], abs=1e-4)
    assert activations.std() == pytest.approx(golden["backbone"]["std"], abs=1e-4)


def test_boxes_are_sampled_as_in_the_golden_values(layers: NumpyLayers, golden: Any) -> None:
    activations, roi = of_noise(layers, 0)[0], golden["roi_align"]
    for box, expected in zip(roi["boxes"], roi["mean_over_channels"], strict=True):
        columns = sampling_matrix(box[0], box[2], n_cells=roi["out"], length=80)
        rows = sampling_matrix(box[1], box[3], n_cells=roi["out"], length=64)
        np.testing.assert_allclose((rows @ activations @ columns.T).mean(axis=0), expected, atol=1e-5)


def test_the_head_gives_the_golden_confidences(layers: NumpyLayers, golden: Any) -> None:
    head = golden["head"]
    target_box, reference_box = (
        np.array(head[name], dtype=np.float64) for name in ("target_box", "reference_box")
    )
    moved = (reference_box[:2] + reference_box[2:] - target_box[:2] - target_box[2:]) / 2
    sampling = Sampling.of(
        target_box=target_box,
        reference_box=target_box + np.tile(moved, 2),
        n_cells=50,
        scales=np.array(head["scales"]),
        target_shape=(64, 80),
        reference_shape=(64, 80),
    )
    target, reference = of_noise(layers, 0), of_noise(layers, 1)
    similarity = similarities(layers, target, reference, [sampling], similarity="dot")
    np.testing.assert_allclose(similarity[0], head["similarity"], atol=1e-3)
    confidence = 1 / (1 + np.exp(-layers.linear("head.scale_preds", similarity)))
    np.testing.assert_allclose(confidence[0], head["confidence"], atol=1e-4)


@pytest.fixture(scope="module")
def deep_scale(shared: Path) -> DeepScale:
    return DeepScale(weights=shared / "deep-scale" / "Deep_TTC.pth")


@pytest.mark.slow
def test_real_frames_reach_their_errors(
    deep_scale: DeepScale, real_clips: tuple[list[Clip], Array], golden: Any
) -> None:
    clips, all_ttc_s = real_clips
    rows = range(0, len(clips), 2)  # half of them: neighbours share nine of ten frames
    ratios = [deep_scale(clips[row], frame_gap=5).scale_ratio for row in rows]
    sketched = [golden["kitti_clip"]["predictions"][str(row)]["deep_scale_float_boxes"] for row in rows]
    np.testing.assert_allclose(ratios, sketched, atol=0.01)
    ttc_s, true_ttc_s = scale_ratio_to_ttc(ratios, fps_hz=2.0), all_ttc_s[::2]
    assert np.mean(MID.errors(ttc_s, true_ttc_s)) <= 12
    assert np.mean(RTE.errors(ttc_s, true_ttc_s)) <= 10.5


def painted_over(path: Path) -> Image:
    """A frame of the notebook without the box and the number drawn into it in red."""
    image = cv2.imread(str(path))
    assert image is not None
    blue, green, red = (image[..., channel].astype(int) for channel in range(3))
    drawn = cv2.dilate((red - np.maximum(blue, green) > 60).astype(np.uint8), np.ones((3, 3), np.uint8))
    return np.asarray(cv2.inpaint(image, drawn, 3, cv2.INPAINT_TELEA), dtype=np.uint8)


@pytest.mark.slow
def test_the_real_sequence_of_the_dataset_has_the_printed_time(deep_scale: DeepScale, shared: Path) -> None:
    source = shared / "tsttc-sequence"
    if not source.is_dir():
        pytest.skip("tsttc-sequence is not here: TSTTC_SHARED_DATA names no folder that has it")
    with (source / "boxes.csv").open(newline="") as file:
        boxes = np.array(
            [[float(row[edge]) for edge in ("x1", "y1", "x2", "y2")] for row in csv.DictReader(file)]
        )
    # The notebook shows the frames of 1024 × 576 pixels smaller.
    frames = [
        np.asarray(
            cv2.resize(painted_over(source / f"{frame}.png"), (1024, 576), interpolation=cv2.INTER_CUBIC)
        )
        for frame in range(6)
    ]
    clip = Clip.from_frames(frames, boxes=boxes * (1024 / 610))
    assert 3.05 <= scale_ratio_to_ttc(deep_scale(clip, frame_gap=5).scale_ratio, fps_hz=2.0) <= 3.35
