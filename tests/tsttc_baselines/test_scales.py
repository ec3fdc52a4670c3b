"""Scale bins and the mean over the best of them."""

import numpy as np
import pytest

from tsttc_baselines import scales


@pytest.mark.parametrize("frame_gap", [1, 2, 3, 4, 5])
def test_bins_are_even_and_reach_both_ends_of_the_range(frame_gap: int) -> None:
    bins = scales.scale_bins(frame_gap=frame_gap, n_bins=125)
    assert (bins[0], bins[-1]) == scales.SCALE_RANGES[frame_gap]
    np.testing.assert_allclose(np.diff(bins), np.ptp(bins) / 124)


@pytest.mark.parametrize(("frame_gap", "n_bins"), [(0, 125), (6, 125), (5, 1)])
def test_gaps_and_counts_that_mean_nothing_are_refused(frame_gap: int, n_bins: int) -> None:
    with pytest.raises(ValueError, match="expected"):
        scales.scale_bins(frame_gap=frame_gap, n_bins=n_bins)


def test_the_first_of_equal_errors_comes_first() -> None:
    assert scales.best_of(np.array([2.0, 1.0, 1.0, 3.0]), n_top=2).tolist() == [1, 2]


def test_a_perfect_match_takes_the_whole_weight() -> None:
    assert scales.weighted_scale_ratio(np.array([0.8, 0.9, 1.0]), np.array([5.0, 0.0, 5.0])) == pytest.approx(
        0.9
    )


def test_ranges_are_those_of_the_toolkit() -> None:
    assert scales.SCALE_RANGES == {
        1: (0.9, 1.08), 2: (0.8, 1.2), 3: (0.75, 1.25), 4: (0.7, 1.4), 5: (0.65, 1.5),
    }  # fmt: skip


def test_an_error_of_nothing_counts_as_a_millionth() -> None:
    ratio = scales.weighted_scale_ratio(np.array([1.0, 2.0]), np.array([0.0, 1e-6]))
    assert ratio == pytest.approx(1.5)


@pytest.mark.parametrize("shift", [(-2, 1), (0, 0), (2, -2), (1, 2)])
def test_the_best_shift_is_x_and_y_from_the_middle(shift: tuple[int, int]) -> None:
    errors = np.full((2, 5, 5), 3.0)
    errors[1, 2 + shift[1], 2 + shift[0]] = 1.0
    least, shifts = scales.at_best_shifts(errors)
    assert least.tolist() == [3.0, 1.0]
    assert shifts[1].tolist() == list(shift)
