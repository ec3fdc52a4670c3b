"""Pixel MSE on real frames with lidar distances, against what the paper's ablations say of it."""

import itertools

import numpy as np
import pytest

from evaluator import fps_of_gap, scale_ratio_to_ttc
from evaluator.metrics.registry import RTE
from tests.tsttc_baselines.scenes import Floats, mean_mid
from tsttc_baselines.clips import Clip
from tsttc_baselines.estimates import Estimator
from tsttc_baselines.pixel_mse import SEARCHES, PixelMse

Real = tuple[list[Clip], Floats]


def ratios(clips: list[Clip], estimator: Estimator, *, frame_gap: int = 5) -> list[float]:
    return [estimator(clip, frame_gap=frame_gap).scale_ratio for clip in clips]


def mid(real: Real, estimator: Estimator, *, frame_gap: int = 5) -> float:
    clips, truth = real
    return mean_mid(ratios(clips, estimator, frame_gap=frame_gap), truth, frame_gap=frame_gap)


def with_loose_boxes(real: Real) -> Real:
    """The same sequences with edges off by 1.5 % of the side, as a detector's: the clip's own are drawn."""
    rng = np.random.default_rng(1)
    clips, truth = real
    return [
        Clip(
            clip.anno_id,
            clip.boxes + 0.015 * rng.normal(size=(6, 4)) * np.tile(clip.boxes[:, 2:] - clip.boxes[:, :2], 2),
            clip.load,
        )
        for clip in clips
    ], truth


@pytest.mark.slow
@pytest.mark.parametrize("search", SEARCHES)
def test_the_papers_variant_reaches_its_errors_on_real_frames(real_clips: Real, search: str) -> None:
    estimates = ratios(real_clips[0], PixelMse(search=search))
    assert mean_mid(estimates, real_clips[1]) <= 20
    assert np.mean(RTE.errors(scale_ratio_to_ttc(estimates, fps_hz=fps_of_gap(5)), real_clips[1])) <= 21


@pytest.mark.slow
def test_the_toolkits_variant_is_worse_as_it_should_be(real_clips: Real) -> None:
    assert 19 <= mid(real_clips, PixelMse(variant="toolkit")) <= 30


@pytest.mark.slow
def test_shifts_halve_the_error_where_boxes_are_loose(real_clips: Real) -> None:
    loose = with_loose_boxes(real_clips)
    assert mid(loose, PixelMse(shift=0)) >= 2 * mid(loose, PixelMse(shift=3))


@pytest.mark.slow
def test_the_error_falls_with_every_frame_of_gap(real_clips: Real) -> None:
    errors = [mid(real_clips, PixelMse(), frame_gap=gap) for gap in range(1, 6)]
    assert all(wider < narrower for narrower, wider in itertools.pairwise(errors))


@pytest.mark.slow
def test_more_bins_are_not_worse(real_clips: Real) -> None:
    assert mid(real_clips, PixelMse(bins=125)) <= 1.05 * mid(real_clips, PixelMse(bins=25))
