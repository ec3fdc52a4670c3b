"""The weights that come with the package: their card, and their errors on real frames."""

import numpy as np
import pytest

from tests.tsttc_baselines.scenes import Floats, mean_mid
from tsttc_baselines.clips import Clip
from tsttc_baselines.deep_scale.estimator import DeepScale
from tsttc_baselines.pixel_mse import PixelMse
from tsttc_baselines.rendering.clips import render
from tsttc_baselines.simulation import split

SEED, N = 7, 20
"""The first of the rendered sequences of docs/deep-scale.md, from which nothing was learned."""


@pytest.mark.slow
def test_on_rendered_frames_they_beat_the_papers_pixel_mse() -> None:
    drawn = split(rng=np.random.default_rng(SEED), n_sequences=320, n_recordings=8)
    clips = [render(drawn, anno_id=row, seed=SEED).clip for row in range(N)]
    ours, theirs = (
        mean_mid([method(clip, frame_gap=5).scale_ratio for clip in clips], drawn.truth.ttc_s[:N])
        for method in (DeepScale(), PixelMse())
    )
    assert ours < theirs


@pytest.mark.slow
def test_on_real_frames_they_reach_the_errors_of_the_toolkits(
    real_clips: tuple[list[Clip], Floats],
) -> None:
    clips, ttc_s = real_clips
    ratios = [DeepScale()(clip, frame_gap=5).scale_ratio for clip in clips[::2]]
    assert mean_mid(ratios, ttc_s[::2]) <= 12
