"""Figures: what they show, in both formats."""

import xml.etree.ElementTree as ET

import cv2
import numpy as np
import pytest

from baselines.clips import Clip
from baselines.drawing import PNG_SCALE, THEMES, Dot, Figure, Picture, Text, outline
from baselines.estimates import Unusable
from baselines.figures import search_figure
from baselines.pixel_mse import PixelMse
from tests.baselines.warped_frames import planted

SVG = "{http://www.w3.org/2000/svg}"


def texts(figure: Figure) -> str:
    return "\n".join(shape.text for shape in figure.shapes if isinstance(shape, Text))


def decoded(figure: Figure) -> np.ndarray:
    return np.asarray(cv2.imdecode(np.frombuffer(figure.png(), np.uint8), cv2.IMREAD_COLOR))


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


def test_the_svg_is_whole_and_reads_nothing_else(clip: Clip) -> None:
    document = search_figure(clip, estimator=PixelMse(), frame_gap=5).svg()
    root = ET.fromstring(document)
    assert root.find(f"{SVG}title").text.startswith("Sequence 0: α = ")
    assert {child.tag.removeprefix(SVG) for child in root} == {
        *("title", "rect", "image", "polygon", "polyline", "circle", "text")
    }
    assert all(image.get("href").startswith("data:image/jpeg;base64,") for image in root.iter(f"{SVG}image"))
    assert "<style" not in document


def test_the_png_has_two_pixels_a_unit_and_the_colours_of_its_theme(clip: Clip) -> None:
    figure = search_figure(clip, estimator=PixelMse(), frame_gap=5, theme="dark")
    pixels = decoded(figure)
    assert pixels.shape == (figure.height * PNG_SCALE, figure.width * PNG_SCALE, 3)
    assert pixels[0, 0].tolist() == [0x15, 0x12, 0x0F]


def test_both_formats_draw_a_shape_at_the_same_place() -> None:
    figure = Figure(100, 60, THEMES["light"], "A box & a dot")
    figure.shapes += [outline([10, 10, 40, 50], colour="#ff0000"), Dot(70, 30, 5, "#0000ff")]
    pixels = decoded(figure)
    assert pixels[60, 140].tolist() == [255, 0, 0]  # blue first
    assert pixels[60, 20].tolist() == [0, 0, 255]
    root = ET.fromstring(figure.svg())
    assert root.find(f"{SVG}polygon").get("points") == "10.00,10.00 40.00,10.00 40.00,50.00 10.00,50.00"
    assert root.find(f"{SVG}title").text == "A box & a dot"


def test_a_toolkits_search_has_no_figure(clip: Clip) -> None:
    with pytest.raises(ValueError, match="paper's variant"):
        search_figure(clip, estimator=PixelMse(variant="toolkit"), frame_gap=5)


def test_a_clip_without_an_estimate_has_no_figure(clip: Clip) -> None:
    without_boxes = Clip(0, np.full((6, 4), np.nan), clip.load)
    with pytest.raises(Unusable):
        search_figure(without_boxes, estimator=PixelMse(), frame_gap=5)
