"""Trackers follow the target box back to the reference frame; those that know no size are refused."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.tsttc_baselines.scenes import Floats, changed, mean_mid, planted, swapped
from tsttc_baselines.clips import TARGET, Clip, Image
from tsttc_baselines.estimates import Unusable
from tsttc_baselines.tracking import TrackerRefused, Tracking, median_flow

track = Tracking()


def alpha(clip: Clip, frame_gap: int = TARGET) -> float:
    return track(clip, frame_gap=frame_gap).scale_ratio


@pytest.mark.parametrize("scale_ratio", [0.68, 0.85, 1.0, 1.15, 1.45])
def test_median_flow_finds_a_planted_scale_ratio(scale_ratio: float) -> None:
    assert alpha(planted(scale_ratio)) == pytest.approx(scale_ratio, rel=5e-3)


@pytest.mark.parametrize("frame_gap", [1, 3])
def test_the_box_is_followed_to_the_reference_frame(frame_gap: int) -> None:
    assert alpha(planted(0.8), frame_gap) == pytest.approx(0.8 ** (frame_gap / 5), rel=5e-3)


def test_the_followed_box_is_where_the_object_is() -> None:
    clip = planted(0.8, shift=(9.0, -6.0))
    frames = [clip.grey(frame) for frame in reversed(range(TARGET + 1))]
    box, confidence = median_flow(frames, box=clip.boxes[TARGET])
    assert box == pytest.approx(clip.boxes[0], abs=0.5)
    assert 0 < confidence <= 1


def test_only_the_target_box_is_needed() -> None:
    clip = planted(0.9)
    expected = alpha(clip)
    clip.boxes[:TARGET] = np.nan
    assert alpha(clip) == expected


def test_frames_in_reverse_order_give_the_reciprocal() -> None:
    clip = planted(0.8)
    assert alpha(clip) * alpha(swapped(clip)) == pytest.approx(1, rel=0.01)


def test_a_scene_without_texture_is_unusable() -> None:
    with pytest.raises(Unusable, match="too few points"):
        alpha(changed(planted(0.9), lambda _, image: np.full_like(image, 100)))


def test_an_object_that_vanishes_is_unusable() -> None:
    def replace(frame: int, image: Image) -> Image:
        noise = np.random.default_rng(frame).integers(0, 255, image.shape, dtype=np.uint8)
        return image if frame == TARGET else noise

    with pytest.raises(Unusable):
        alpha(changed(planted(0.9), replace))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"tracker": "kcf"}, "'kcf' never changes the size of its box.*median-flow"),
        ({"tracker": "mil"}, "'mil' never changes the size of its box.*median-flow"),
        ({"tracker": "sift"}, "'sift' is unknown; use one of median-flow, csrt, nano"),
        ({"tracker": "nano", "backbone": "backbone.onnx"}, "two model files"),
        ({"tracker": "nano", "backbone": "b.onnx", "head": "h.onnx"}, r"b\.onnx does not exist"),
    ],
)
def test_trackers_that_cannot_be_used_are_refused_in_words(options: dict[str, Any], words: str) -> None:
    with pytest.raises(TrackerRefused, match=words):
        Tracking(**options)


def test_csrt_runs_where_opencv_has_it_and_is_refused_in_words_elsewhere() -> None:
    if hasattr(cv2, "TrackerCSRT_create"):
        estimate = Tracking(tracker="csrt")(planted(0.8), frame_gap=TARGET)
        assert estimate.scale_ratio == pytest.approx(0.8, abs=0.1)
    else:
        with pytest.raises(TrackerRefused, match="opencv-contrib-python-headless"):
            Tracking(tracker="csrt")


class Halving:
    """A tracker of OpenCV's kind whose box has half the sides after each step."""

    def init(self, _frame: Image, box: tuple[int, int, int, int]) -> None:
        self.box = box

    def update(self, _frame: Image) -> tuple[bool, tuple[int, int, int, int]]:
        x, y, width, height = self.box
        self.box = (x, y, width // 2, height // 2)
        return True, self.box


def test_nano_track_follows_with_the_models_that_are_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    models = {name: tmp_path / f"{name}.onnx" for name in ("backbone", "head")}
    for path in models.values():
        path.write_bytes(b"no model")
    with pytest.raises(TrackerRefused, match="cannot read the models"):
        Tracking(tracker="nano", **models)
    monkeypatch.setattr(cv2, "TrackerNano_create", lambda _parameters: Halving())
    follow, clip = Tracking(tracker="nano", **models), planted(0.8, box_px=(64.0, 64.0))
    for frame_gap in (1, 2):
        assert follow(clip, frame_gap=frame_gap).scale_ratio == pytest.approx(0.5**frame_gap)


@pytest.mark.slow
def test_the_error_on_real_frames_is_at_most_13_mid(real_clips: tuple[list[Clip], Floats]) -> None:
    clips, ttc_s = real_clips
    assert mean_mid([alpha(clip) for clip in clips], ttc_s) <= 13
