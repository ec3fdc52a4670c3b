"""Rendered frames: reproducible one by one, true in scale, and wide enough for what looks at them."""

import numpy as np
import pytest

from evaluator.metrics.scale import scale_ratio_to_ttc
from tsttc_baselines.boxes import scale_ratio_of_boxes
from tsttc_baselines.highway import VEHICLES
from tsttc_baselines.rendering.clips import View, boxes, render
from tsttc_baselines.simulation import Split, split

SEED = 3


@pytest.fixture(scope="module")
def drawn() -> Split:
    return split(rng=np.random.default_rng(SEED), n_sequences=600, n_recordings=20)


def widths_px(drawn: Split) -> np.ndarray:
    width_m = np.array([VEHICLES[vehicle].width_m for vehicle in drawn.vehicle])
    return np.asarray(drawn.focal_px * width_m / drawn.gap_m[:, -1])


def test_the_area_rule_errs_as_in_the_published_row(drawn: Split) -> None:
    detected = np.stack([boxes(drawn, anno_id=row, seed=SEED)[1] for row in range(drawn.n_sequences)])
    area = scale_ratio_of_boxes(detected[:, 0], detected[:, 5], measure="area")
    ttc_s = drawn.truth.ttc_s
    estimate_s = np.clip(scale_ratio_to_ttc(area, fps_hz=2), -20, 20)
    relative = 100 * np.abs(estimate_s - ttc_s) / np.abs(ttc_s)
    for low_s, high_s in ((0, 3), (3, 6), (6, 20), (-20, 0)):
        inside = (ttc_s >= low_s) & (ttc_s <= high_s)
        assert 45 <= relative[inside].mean() <= 75


@pytest.mark.slow
def test_the_same_seed_and_sequence_give_the_same_bytes_in_any_order(drawn: Split) -> None:
    first = [render(drawn, anno_id=row, seed=SEED) for row in (0, 7)]
    again = [render(drawn, anno_id=row, seed=SEED) for row in (7, 0)][::-1]
    for one, other in zip(first, again, strict=True):
        assert one.jpegs == other.jpegs
        np.testing.assert_array_equal(one.boxes, other.boxes)
    assert render(drawn, anno_id=0, seed=SEED + 1).jpegs != first[0].jpegs


@pytest.mark.slow
def test_boxes_lie_in_the_image_near_the_vehicle(drawn: Split) -> None:
    for row in range(0, 60, 6):
        rendered = render(drawn, anno_id=row, seed=SEED)
        height, width = rendered.clip.grey(0).shape
        assert (rendered.boxes >= 0).all()
        assert (rendered.boxes <= [width, height] * 2).all()
        side = rendered.true_boxes[:, 2] - rendered.true_boxes[:, 0]
        assert (np.abs(rendered.boxes - rendered.true_boxes) < 5 * (0.03 * side + 0.6)[:, None]).all()
        np.testing.assert_allclose(side[5], widths_px(drawn)[row])


def test_a_view_of_the_whole_image_shows_the_same_scene(drawn: Split) -> None:
    part = render(drawn, anno_id=3, seed=SEED)
    whole = render(drawn, anno_id=3, seed=SEED, view=View(left=0, top=0, width=1024, height=576))
    assert whole.clip.colour(0).shape == (576, 1024, 3)
    shift = np.round(whole.true_boxes[0, :2] - part.true_boxes[0, :2]).astype(int)
    cut = whole.clip.grey(5)[shift[1] :, shift[0] :][
        : part.clip.grey(5).shape[0], : part.clip.grey(5).shape[1]
    ]
    assert np.corrcoef(cut.ravel(), part.clip.grey(5).ravel())[0, 1] > 0.98
