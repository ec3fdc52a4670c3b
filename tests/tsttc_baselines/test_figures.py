"""Figures: what they show, in both formats."""

import pytest

from tests.tsttc_baselines.warped_frames import planted
from tsttc_baselines.clips import Clip
from tsttc_baselines.drawing import Dot, Figure, Picture, Text
from tsttc_baselines.figures import search_figure
from tsttc_baselines.pixel_mse import PixelMse


def texts(figure: Figure) -> str:
    return "\n".join(shape.text for shape in figure.shapes if isinstance(shape, Text))


@pytest.fixture(scope="module")
def clip() -> Clip:
    return planted(3, scale_ratio=0.8)


def test_the_search_figure_names_the_estimate_and_the_truth(clip: Clip) -> None:
    figure = search_figure(clip, estimator=PixelMse(), frame_gap=5, true_ttc_s=2.0)
    estimate = PixelMse()(clip, frame_gap=5).scale_ratio
    assert f"α = {estimate:.3f}" in texts(figure)
    assert "truth 0.800" in texts(figure)
    assert figure.title.endswith("true TTC 2.0 s")
    assert sum(isinstance(shape, Picture) for shape in figure.shapes) == 4
    assert sum(isinstance(shape, Dot) for shape in figure.shapes) == 3  # the best scale ratios


def test_without_a_truth_none_is_drawn(clip: Clip) -> None:
    assert "truth" not in texts(search_figure(clip, estimator=PixelMse(), frame_gap=3))


def test_a_toolkits_search_has_no_figure(clip: Clip) -> None:
    with pytest.raises(ValueError, match="paper's variant"):
        search_figure(clip, estimator=PixelMse(variant="toolkit"), frame_gap=5)
