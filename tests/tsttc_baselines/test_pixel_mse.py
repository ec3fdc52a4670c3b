"""Pixel MSE: true to planted scale ratios, indifferent to what must not matter, plain about its limits."""

import numpy as np
import pytest

from tests.tsttc_baselines.scenes import swapped
from tests.tsttc_baselines.warped_frames import planted, rescaled, texture
from tsttc_baselines.clips import Clip, Image
from tsttc_baselines.estimates import Unusable
from tsttc_baselines.pixel_mse import SEARCHES, PixelMse
from tsttc_baselines.scales import SCALE_RANGES

BIN = (1.5 - 0.65) / 124
RATIOS = (0.72, 0.85, 0.97, 1.0, 1.08, 1.3)


@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.parametrize("scale_ratio", RATIOS)
def test_a_planted_scale_ratio_is_recovered_within_half_a_bin(scale_ratio: float, search: str) -> None:
    estimate = PixelMse(search=search)(planted(3, scale_ratio=scale_ratio), frame_gap=5)
    assert estimate.scale_ratio == pytest.approx(scale_ratio, abs=BIN / 2)
    assert estimate.confidence > 0.9


@pytest.mark.parametrize("frame_gap", [1, 2, 3, 4])
def test_every_frame_gap_finds_a_ratio_of_its_range(frame_gap: int) -> None:
    low, high = SCALE_RANGES[frame_gap]
    planted_ratio = low + 0.3 * (high - low)
    estimate = PixelMse()(planted(4, scale_ratio=planted_ratio), frame_gap=frame_gap)
    assert estimate.scale_ratio == pytest.approx(planted_ratio, abs=BIN / 2)


@pytest.mark.parametrize("scale_ratio", RATIOS)
def test_swapped_frames_give_the_reciprocal(scale_ratio: float) -> None:
    clip = planted(5, scale_ratio=scale_ratio)
    there, back = (PixelMse()(each, frame_gap=5).scale_ratio for each in (clip, swapped(clip)))
    assert there * back == pytest.approx(1, rel=0.01)


@pytest.mark.parametrize("factor", [0.5, 0.8, 1.25, 2.0])
def test_larger_or_smaller_images_keep_the_scale_ratio(factor: float) -> None:
    clip = planted(6, scale_ratio=0.88)
    estimates = [PixelMse()(each, frame_gap=5).scale_ratio for each in (clip, rescaled(clip, factor))]
    assert estimates[1] == pytest.approx(estimates[0], rel=0.01)


@pytest.mark.parametrize("search", SEARCHES)
def test_a_box_off_its_object_costs_little_with_shifts_and_much_without(search: str) -> None:
    clip = planted(7, scale_ratio=0.8)
    moved = Clip(clip.anno_id, clip.boxes + np.eye(6)[0][:, np.newaxis] * [2, -2, 2, -2], clip.load)
    misses = [abs(PixelMse(shift=c, search=search)(moved, frame_gap=5).scale_ratio - 0.8) for c in (3, 0)]
    assert misses[0] < 0.01
    assert misses[1] > 2 * misses[0]


def test_the_coarse_search_ends_at_the_bins_of_the_full_one() -> None:
    clip = planted(8, scale_ratio=1.17, size=(130, 100))
    full, fine = (PixelMse(search=search).match(clip, frame_gap=5) for search in SEARCHES)
    assert fine.scale_ratio == full.scale_ratio
    assert len(fine.scales) < len(full.scales) / 5


@pytest.mark.slow
def test_the_toolkits_variant_finds_approaching_objects_and_loses_receding_ones() -> None:
    variant = PixelMse(variant="toolkit")
    approaching, receding = (
        variant(planted(10, scale_ratio=scale_ratio, size=(110, 90)), frame_gap=5).scale_ratio / scale_ratio
        for scale_ratio in (0.9, 1.3)
    )
    assert approaching == pytest.approx(1, abs=0.01)
    assert abs(receding - 1) > 0.03


@pytest.mark.parametrize("variant", ["paper", "toolkit"])
def test_a_box_at_the_border_is_estimated_all_the_same(variant: str) -> None:
    image = texture(11)
    box = np.array([-12.0, -8, 50, 40])
    clip = Clip.from_frames([image] * 6, boxes=np.array([box] * 6))
    assert PixelMse(variant=variant)(clip, frame_gap=5).scale_ratio == pytest.approx(1, abs=2 * BIN)


def unusable_clips() -> dict[str, Clip]:
    image = texture(12)
    box = np.array([100.0, 80, 160, 130])

    def clip(reference: object, frame: Image = image) -> Clip:
        return Clip.from_frames([frame] * 6, boxes=np.array([reference] * 5 + [box], dtype=np.float64))

    return {
        "no box in the reference frame": clip([np.nan] * 4),
        "reference box under 4 px": clip([100, 80, 103, 130]),
        "reference box outside the image": clip([400, 80, 460, 130]),
        "box without texture": clip(box, np.full_like(image, 90)),
    }


@pytest.mark.parametrize("variant", ["paper", "toolkit"])
@pytest.mark.parametrize("reason", unusable_clips())
def test_a_clip_that_shows_nothing_is_unusable_and_says_why(reason: str, variant: str) -> None:
    with pytest.raises(Unusable, match=reason):
        PixelMse(variant=variant)(unusable_clips()[reason], frame_gap=5)


def test_a_frame_gap_beyond_the_sequence_is_refused() -> None:
    with pytest.raises(ValueError, match="expected 1 to 5"):
        PixelMse()(planted(1, scale_ratio=1.0), frame_gap=6)
