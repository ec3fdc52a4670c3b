"""Pixel MSE on rendered frames."""

import itertools

import cv2
import numpy as np
import pytest

from tests.tsttc_baselines.scenes import Floats, mean_mid
from tsttc_baselines.clips import Clip
from tsttc_baselines.estimates import Estimator
from tsttc_baselines.pixel_mse import PixelMse
from tsttc_baselines.rendering.clips import Rendered, render
from tsttc_baselines.simulation import split

pytestmark = pytest.mark.slow

SEED, N = 1, 48


@pytest.fixture(scope="module")
def rendered() -> tuple[list[Rendered], Floats]:
    """Sequences in all TTC ranges, and their true times to contact."""
    drawn = split(rng=np.random.default_rng(SEED), n_sequences=N, n_recordings=4)
    return [render(drawn, anno_id=row, seed=SEED) for row in range(N)], drawn.truth.ttc_s


def mid(clips: list[Clip], truth: Floats, estimator: Estimator, *, frame_gap: int = 5) -> float:
    return mean_mid(
        [estimator(c, frame_gap=frame_gap).scale_ratio for c in clips], truth, frame_gap=frame_gap
    )


def decoded(sequence: Rendered, boxes: Floats) -> Clip:
    frames = [
        np.asarray(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE))
        for jpeg in sequence.jpegs
    ]
    return Clip.from_frames(frames, boxes=boxes)


def test_the_error_falls_with_every_frame_of_gap(rendered: tuple[list[Rendered], Floats]) -> None:
    sequences, truth = rendered
    clips = [decoded(each, each.boxes) for each in sequences]
    errors = [mid(clips, truth, PixelMse(), frame_gap=gap) for gap in range(1, 6)]
    assert all(wider < narrower for narrower, wider in itertools.pairwise(errors))


def test_shifts_halve_the_error_where_each_box_errs_by_itself(
    rendered: tuple[list[Rendered], Floats],
) -> None:
    sequences, truth = rendered
    rng = np.random.default_rng(SEED)
    clips = []
    for each in sequences:
        sides = np.tile(each.true_boxes[:, 2:] - each.true_boxes[:, :2], 2)
        noise = rng.normal(size=(6, 4)) * (0.015 * sides + 0.6)
        clips.append(decoded(each, each.true_boxes + noise))
    assert mid(clips, truth, PixelMse(shift=0)) >= 2 * mid(clips, truth, PixelMse(shift=3))
