"""Photometric alignment finds planted scale ratios, whatever happens to exposure, order and image size."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.tsttc_baselines.scenes import Floats, changed, mean_mid, planted, swapped
from tsttc_baselines.alignment import Alignment
from tsttc_baselines.clips import TARGET, Clip, Image
from tsttc_baselines.estimates import Unusable

align = Alignment()


def alpha(clip: Clip, frame_gap: int = TARGET) -> float:
    return align(clip, frame_gap=frame_gap).scale_ratio


@pytest.mark.slow
@pytest.mark.parametrize("scale_ratio", [0.68, 0.8, 0.9, 0.97, 1.0, 1.06, 1.2, 1.45])
def test_a_planted_scale_ratio_is_recovered(scale_ratio: float) -> None:
    assert alpha(planted(scale_ratio)) == pytest.approx(scale_ratio, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("frame_gap", [1, 2, 3, 4])
def test_any_frame_can_be_the_reference(frame_gap: int) -> None:
    assert alpha(planted(0.8), frame_gap) == pytest.approx(0.8 ** (frame_gap / 5), abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("gain", "offset"), [(0.6, 0), (0.85, 15), (1.15, -15), (1.0, 12), (1.05, 3)])
def test_gain_and_offset_move_the_estimate_by_less_than_a_thousandth(gain: float, offset: float) -> None:
    clip = planted(0.85)

    def expose(frame: int, image: Image) -> Image:
        factor, level = (gain, offset) if frame < TARGET else (1.0, 0.0)
        return np.clip(np.round(factor * image + level), 0, 255).astype(np.uint8)

    assert alpha(changed(clip, expose)) == pytest.approx(alpha(clip), abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("scale_ratio", [0.75, 0.92, 1.25])
def test_frames_in_reverse_order_give_the_reciprocal(scale_ratio: float) -> None:
    clip = planted(scale_ratio)
    assert alpha(clip) * alpha(swapped(clip)) == pytest.approx(1, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("zoom", [0.5, 0.7, 1.4, 2.0])
def test_the_size_of_the_image_does_not_matter(zoom: float) -> None:
    clip = planted(0.85)

    def resize(_: int, image: Image) -> Image:
        interpolation = cv2.INTER_AREA if zoom < 1 else cv2.INTER_CUBIC
        resized = cv2.resize(image, None, fx=zoom, fy=zoom, interpolation=interpolation)
        return np.asarray(resized, dtype=np.uint8)

    resized = replace(changed(clip, resize), boxes=clip.boxes * zoom)
    assert alpha(resized) == pytest.approx(alpha(clip), rel=0.01)


@pytest.mark.slow
def test_a_wrong_reference_box_does_no_harm() -> None:
    clip = planted(0.8)
    clip.boxes[0] += np.array([-4, -4, 4, 4])  # larger by about a tenth, so the boxes alone say 0.88
    assert alpha(clip) == pytest.approx(0.8, abs=2e-3)


@pytest.mark.parametrize("level", [0, 128, 255])
def test_a_box_without_texture_is_unusable(level: int) -> None:
    clip = changed(planted(0.85), lambda _, image: np.full_like(image, level))
    with pytest.raises(Unusable, match="texture"):
        alpha(clip)


def test_a_box_at_the_edge_of_the_image_is_aligned_with_what_is_there() -> None:
    clip = planted(0.9, shift=(0, 0))
    left = int(clip.boxes[TARGET][0]) + 5
    cut = replace(changed(clip, lambda _, image: image[:, left:]), boxes=clip.boxes - [left, 0, left, 0])
    assert alpha(cut) == pytest.approx(0.9, abs=0.03)


@pytest.mark.slow
def test_the_error_on_real_frames_is_at_most_11_5_mid(real_clips: tuple[list[Clip], Floats]) -> None:
    clips, ttc_s = real_clips
    assert mean_mid([alpha(clip) for clip in clips], ttc_s) <= 11.5
