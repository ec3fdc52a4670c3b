"""The network's parts against their definitions, and numpy against torch."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import convolve2d, correlate2d

from tests.tsttc_baselines.deep_scale.made_weights import random_tensors
from tests.tsttc_baselines.scenes import planted
from tsttc_baselines.clips import Clip
from tsttc_baselines.deep_scale.crops import cut_pair
from tsttc_baselines.deep_scale.estimator import DeepScale, cut, network_logits, operations_on
from tsttc_baselines.deep_scale.layers import convolved, doubled
from tsttc_baselines.deep_scale.roi_align import sampling_matrix
from tsttc_baselines.deep_scale.weights import Use, Weights, write_weights
from tsttc_baselines.estimates import Unusable

Floats = NDArray[Any]

RNG = np.random.default_rng(3)


@pytest.mark.parametrize(
    ("size", "stride", "shape"), [(7, 1, (9, 13)), (7, 2, (10, 13)), (3, 1, (5, 4)), (1, 1, (3, 2))]
)
def test_a_convolution_is_a_sum_of_correlations(size: int, stride: int, shape: tuple[int, int]) -> None:
    image = RNG.normal(size=(*shape, 3)).astype(np.float32)
    weight = RNG.normal(size=(4, 3, size, size)).astype(np.float32)
    kernel = weight.transpose(2, 3, 1, 0).reshape(size, -1, 4)
    expected = [
        sum(correlate2d(image[..., channel], each[channel], mode="same") for channel in range(3))
        for each in weight
    ]
    output = convolved(image, kernel, np.arange(4, dtype=np.float32), stride=stride)
    np.testing.assert_allclose(
        output.transpose(2, 0, 1),
        np.array(expected)[:, ::stride, ::stride] + np.arange(4)[:, None, None],
        atol=1e-4,
    )


def test_a_transposed_convolution_spreads_each_value_over_nine() -> None:
    images = RNG.normal(size=(1, 4, 3, 2)).astype(np.float32)
    kernel = RNG.normal(size=(2, 5, 3, 3)).astype(np.float32)
    apart = np.zeros((2, 8, 6))
    apart[:, ::2, ::2] = images[0].transpose(2, 0, 1)
    # Stride 2, padding 1, output padding 1: the full convolution without its first row and column.
    expected = [sum(convolve2d(apart[i], kernel[i, o]) for i in range(2))[1:9, 1:7] for o in range(5)]
    np.testing.assert_allclose(doubled(images, kernel)[0].transpose(2, 0, 1), expected, atol=1e-5)


def literal_cell(values: Floats, low: float, high: float, cell: int, n_cells: int) -> float:
    """One cell along one axis, sample by sample, as torchvision's `roi_align_common.h` does it."""
    side = max(high - low, 1.0)
    n_samples = int(np.ceil(side / n_cells))
    total = 0.0
    for sample in range(n_samples):
        position = low + side / n_cells * (cell + (sample + 0.5) / n_samples)
        if position < -1 or position > len(values):
            continue
        position = max(position, 0.0)
        below = int(position)
        if below >= len(values) - 1:
            total += values[-1]
        else:
            total += values[below] * (below + 1 - position) + values[below + 1] * (position - below)
    return total / n_samples


@pytest.mark.parametrize(("low", "high"), [(2.3, 9.9), (-3.0, 4.0), (5.0, 16.5), (3.0, 3.2), (-20.0, -10.0)])
def test_cells_are_sampled_as_torchvision_samples_them(low: float, high: float) -> None:
    values = RNG.normal(size=12)
    expected = [literal_cell(values, low, high, cell, 5) for cell in range(5)]
    sampled = sampling_matrix(low, high, n_cells=5, length=12) @ values
    np.testing.assert_allclose(sampled, expected, atol=1e-12)


def test_crops_keep_boxes_where_they_are_beyond_the_border_and_shrunk() -> None:
    image = RNG.integers(0, 255, (60, 80, 3), dtype=np.uint8)
    boxes = np.array([50.0, 20, 78, 50]), np.array([52.5, 22, 79.5, 54])
    pair = cut_pair(image, image, boxes, max_scale=1.5, max_box_px=16.0, margin_px=8.0, n_cells=25)
    for crop in (pair.reference, pair.target):
        assert crop.pixels.shape[0] % 2 == crop.pixels.shape[1] % 2 == 0
        assert np.all(crop.box[:2] >= 8)
        assert np.all(crop.box[2:] + 8 <= crop.pixels.shape[1::-1])
    sides = pair.target.box[2:] - pair.target.box[:2]
    assert max(sides) == pytest.approx(16, rel=0.05)
    # Never larger than the image allows: the target ends half a pixel before the border.
    assert sides[0] / sides[1] == pytest.approx(27 / 32, rel=0.05)


@pytest.fixture(scope="module")
def scene() -> Clip:
    return planted(0.8)


@pytest.mark.torch
@pytest.mark.parametrize("similarity", ["dot", "cosine"])
def test_numpy_and_torch_give_the_same(scene: Clip, similarity: Any) -> None:
    use = Use(similarity=similarity, n_cells=10, max_box_px=24.0, margin_px=8.0)
    weights = Weights(random_tensors(), use)
    pair = cut((scene.colour(0), scene.colour(5)), (scene.boxes[0], scene.boxes[5]), use=use)
    one, other = (
        np.asarray(network_logits(operations_on(device, weights), [pair], use=use))
        for device in ("numpy", "cpu")
    )
    np.testing.assert_allclose(one, other, atol=1e-3, rtol=1e-3)


def test_no_estimate_without_boxes_of_a_size(tmp_path: Path, scene: Clip) -> None:
    write_weights(tmp_path / "w.npz", Weights(random_tensors()))
    estimator = DeepScale(weights=tmp_path / "w.npz")
    boxes = scene.boxes.copy()
    boxes[0, 2:] = boxes[0, :2] + 2
    with pytest.raises(Unusable, match="reference box under 4 px"):
        estimator(Clip(0, boxes, scene.load), frame_gap=5)
