"""The estimate from a fit: which scale ratio it finds, from where, and when it is used."""

import numpy as np
import pytest

from tests.tsttc_baselines.scenes import Floats, planted
from tsttc_baselines.boxes import box_around, centre_of, size_of
from tsttc_baselines.clips import Clip, Image
from tsttc_baselines.deep_scale.estimator import DeepScale
from tsttc_baselines.deep_scale.fit import Grid, fitted_scale_ratio
from tsttc_baselines.deep_scale.layers import NumpyLayers
from tsttc_baselines.deep_scale.network import Operations
from tsttc_baselines.deep_scale.weights import read_weights
from tsttc_baselines.methods import OWN_WEIGHTS


@pytest.fixture(scope="module")
def operations() -> Operations:
    """The network with the weights of the package."""
    return NumpyLayers(read_weights(OWN_WEIGHTS).tensors)


def pair(clip: Clip) -> tuple[tuple[Image, Image], tuple[Floats, Floats]]:
    """Frames and boxes of reference and target."""
    return (clip.colour(0), clip.colour(5)), (clip.boxes[0], clip.boxes[5])


@pytest.mark.slow
@pytest.mark.parametrize("scale_ratio", [0.7, 0.95, 1.17])
def test_a_planted_scale_ratio_is_recovered_to_a_thousandth(scale_ratio: float) -> None:
    fitted = DeepScale(decoding="fit")(planted(scale_ratio), frame_gap=5).scale_ratio
    assert fitted == pytest.approx(scale_ratio, rel=1e-3)


@pytest.mark.slow
def test_small_boxes_are_enlarged_and_their_scale_ratio_is_recovered() -> None:
    clip = planted(0.95, box_px=(30.0, 24.0), shift=(1.0, -0.6))
    assert DeepScale(decoding="fit")(clip, frame_gap=5).scale_ratio == pytest.approx(0.95, rel=5e-3)
    assert Grid.over(clip.boxes[5], box_px=80.0).pixel_size == pytest.approx(0.5)


@pytest.mark.slow
def test_the_card_of_weights_says_how_they_are_decoded() -> None:
    assert read_weights(OWN_WEIGHTS).use.decoding == "fit"
    clip = planted(0.9)
    auto, fit, head = (
        DeepScale(decoding=decoding)(clip, frame_gap=5).scale_ratio for decoding in ("auto", "fit", "head")
    )
    assert auto == fit != head


@pytest.mark.slow
def test_boxes_that_lie_beside_the_vehicle_hardly_change_the_estimate(operations: Operations) -> None:
    frames, boxes = pair(planted(0.95))
    beside = box_around(centre_of(boxes[0]) + np.array([4.0, -3.0]), size_of(boxes[0]))
    fitted = fitted_scale_ratio(operations, frames, (beside, boxes[1]), near=0.95)
    assert fitted == pytest.approx(0.95, rel=2e-3)


@pytest.mark.slow
def test_without_texture_the_estimate_stays_at_a_start(operations: Operations) -> None:
    _, boxes = pair(planted(0.95))
    grey = np.full((240, 320, 3), 90, dtype=np.uint8)
    fitted = fitted_scale_ratio(operations, (grey, grey), boxes, near=0.93)
    assert min(abs(fitted - 0.93), abs(fitted - 0.95)) < 1e-6
