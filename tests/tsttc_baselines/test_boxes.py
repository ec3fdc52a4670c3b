"""Boxes: expansion within the image, and the scale ratio of two boxes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsttc_baselines import boxes

IMAGE = {"width_px": 1024.0, "height_px": 576.0}
sides = st.floats(4, 300)
coordinates = st.floats(0, 500)


@pytest.mark.slow
@given(x=coordinates, y=coordinates, width=sides, height=sides, ratio=st.floats(0.5, 2))
def test_expansion_keeps_the_centre_and_multiplies_both_sides(
    x: float, y: float, width: float, height: float, ratio: float
) -> None:
    box = np.array([x, y, x + width, y + height])
    grown = boxes.expand(box, ratio)
    np.testing.assert_allclose(boxes.centre_of(grown), boxes.centre_of(box), atol=1e-9)
    np.testing.assert_allclose(boxes.size_of(grown), boxes.size_of(box) * ratio)


@pytest.mark.slow
@given(x=coordinates, y=coordinates, width=sides, height=sides)
def test_the_shared_expansion_keeps_both_boxes_within_the_image(
    x: float, y: float, width: float, height: float
) -> None:
    box = np.array([x, y, min(x + width, 1024), min(y + height, 576)])
    other = np.array([400.0, 200, 500, 300])
    ratio = boxes.shared_expansion(box, other, **IMAGE)
    assert 1.0 <= ratio <= 1.1
    for grown in (boxes.expand(box, ratio), boxes.expand(other, ratio)):
        assert np.all(grown >= -1e-9)
        assert np.all(grown <= [1024 + 1e-9, 576 + 1e-9] * 2)


def test_a_box_beyond_the_edge_is_not_made_smaller() -> None:
    assert boxes.shared_expansion([-20, 10, 40, 60], [10, 10, 60, 60], **IMAGE) == 1.0


def test_the_narrower_of_two_rooms_decides() -> None:
    near_the_edge = [2.0, 100, 82, 180]  # 42 px from the edge to the centre, 40 px half a side
    assert boxes.shared_expansion(near_the_edge, [400, 200, 500, 300], **IMAGE) == pytest.approx(1.05)


@pytest.mark.slow
@given(scale=st.floats(0.5, 2))
def test_every_measure_but_the_area_gives_the_scale_of_the_box(scale: float) -> None:
    target = np.array([100.0, 100, 180, 160])
    reference = boxes.expand(target, scale)
    ratios = {m: float(boxes.scale_ratio_of_boxes(reference, target, measure=m)) for m in boxes.MEASURES}
    assert ratios.pop("area") == pytest.approx(scale**2)
    assert list(ratios.values()) == pytest.approx([scale] * 3)
