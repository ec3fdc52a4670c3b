"""What is changed of a pair to learn from leaves its scale ratio true."""

from collections.abc import Iterator

import numpy as np
import pytest

from tsttc_baselines.pairs import Pair, augmented, can_say

WIDTH, HEIGHT = 96, 64
N = 400


def pair(scale_ratio: float) -> Pair:
    """A box that is smaller in the reference frame by the scale ratio, left of the middle."""
    rng = np.random.default_rng(0)
    reference, target = (rng.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8) for _ in range(2))
    sides = np.array([30.0, 20.0])
    boxes = tuple(
        np.concatenate([[30.0, 32.0] - size / 2, [30.0, 32.0] + size / 2])
        for size in (sides * scale_ratio, sides)
    )
    return Pair(reference, target, boxes, scale_ratio)


def all_of(original: Pair) -> Iterator[Pair]:
    for seed in range(N):
        yield augmented(original, rng=np.random.default_rng(seed))


def side(box: np.ndarray) -> float:
    """The side of a square of the box's area, in pixels."""
    return float(np.sqrt(np.prod(box[2:] - box[:2])))


@pytest.mark.slow
@pytest.mark.parametrize("scale_ratio", [0.7, 0.9, 1.2])
def test_scale_ratio_is_that_of_the_boxes_whatever_is_mirrored_reversed_or_resized(
    scale_ratio: float,
) -> None:
    errors: dict[bool, list[float]] = {False: [], True: []}
    for changed in all_of(pair(scale_ratio)):
        is_resized = changed.reference.shape != changed.target.shape
        ratio = side(changed.boxes[0]) / side(changed.boxes[1])
        errors[is_resized].append(np.log(ratio / changed.scale_ratio))
    # The boxes are moved by a hundredth of their sides: that is four standard errors of the mean.
    for each in errors.values():
        assert len(each) > 50
        assert abs(np.mean(each)) < 4 * 0.02 / np.sqrt(len(each))
        assert 0.005 < np.std(each) < 0.03


@pytest.mark.slow
def test_a_quarter_is_reversed_a_half_mirrored_and_a_third_resized_by_at_most_six_hundredths() -> None:
    changed = list(all_of(pair(0.8)))
    is_reversed = [each.scale_ratio > 1 for each in changed]
    is_mirrored = [each.boxes[1][0] + each.boxes[1][2] > WIDTH for each in changed]
    growths = [
        each.reference.shape[1] / WIDTH for each in changed if each.reference.shape != each.target.shape
    ]
    assert np.mean(is_reversed) == pytest.approx(0.25, abs=0.08)
    assert np.mean(is_mirrored) == pytest.approx(0.5, abs=0.1)
    assert len(growths) / N == pytest.approx(0.3, abs=0.1)
    assert min(growths) >= np.exp(-0.06) - 0.5 / WIDTH
    assert max(growths) <= np.exp(0.06) + 0.5 / WIDTH
    assert min(growths) < 1 < max(growths)


@pytest.mark.slow
@pytest.mark.parametrize("scale_ratio", [0.655, 1.49])
def test_no_pair_says_what_no_bin_can(scale_ratio: float) -> None:
    ratios = [each.scale_ratio for each in all_of(pair(scale_ratio))]
    assert all(0.65 <= ratio <= 1.5 for ratio in ratios)
    assert len(set(ratios)) > 2


@pytest.mark.parametrize(
    ("scale_ratio", "is_said"), [(0.649, False), (0.65, True), (1.5, True), (1.501, False)]
)
def test_what_can_be_said_ends_with_the_bins(scale_ratio: float, is_said: bool) -> None:
    assert can_say(scale_ratio) is is_said


def test_a_mirrored_box_is_over_the_same_pixels() -> None:
    original = pair(0.9)
    light = np.zeros((HEIGHT, WIDTH, 3), dtype=np.uint8)
    light[22:42, 15:45] = 255
    marked = Pair(light, light, original.boxes, original.scale_ratio)
    for seed in range(40):
        changed = augmented(marked, rng=np.random.default_rng(seed))
        x0, y0, x1, y1 = np.round(changed.boxes[1]).astype(int)
        inside = changed.target[y0:y1, x0:x1, 0]
        n_bright = (changed.target[..., 0] > 150).sum()
        assert (inside > 150).mean() > 0.9
        assert (inside > 150).sum() > 0.75 * n_bright


@pytest.mark.slow
def test_colours_of_both_frames_change_alike_and_by_little() -> None:
    grey = np.full((HEIGHT, WIDTH, 3), (90, 120, 150), dtype=np.uint8)
    original = Pair(grey, grey, pair(0.9).boxes, 0.9)
    colours = set()
    for changed in all_of(original):
        reference, target = changed.reference[0, 0], changed.target[0, 0]
        assert np.abs(reference.astype(int) - target.astype(int)).max() <= 1
        assert np.abs(target.astype(int) - grey[0, 0]).max() <= 60
        colours.add(tuple(target.tolist()))
    assert len(colours) > 100
