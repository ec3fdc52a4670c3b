"""The weights that come with the package: what their card says, and what they are good for."""

from pathlib import Path

import numpy as np
import pytest

from baselines.deep_scale.estimator import DeepScale
from baselines.folders import read_folder
from baselines.images import ImageCache
from baselines.pixel_mse import PixelMse
from baselines.rendering.clips import render
from baselines.simulation import split
from evaluator import read_truth
from tests.baselines.scenes import mean_mid

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
def test_on_real_frames_they_reach_the_errors_of_the_toolkits(kitti_clip: Path, clip_folder: Path) -> None:
    folder, cache, method = read_folder(clip_folder), ImageCache(), DeepScale()
    rows = range(0, folder.n_sequences, 2)
    found = [method(folder.clip(row, cache=cache), frame_gap=5).scale_ratio for row in rows]
    assert mean_mid(found, read_truth(kitti_clip / "truth.csv").ttc_s[::2]) <= 12
