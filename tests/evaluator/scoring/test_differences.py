"""The sign-flip test and its interval against plain loops and scipy, and how both are published."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evaluator import compare_predictions, confidence_intervals, evaluate
from evaluator.scoring.differences import N_SIGN_FLIPS, difference, rounded_difference, sign_flips
from evaluator.scoring.significance import LEAST_P, Difference
from tests.evaluator.recordings import Floats, permutation_p, predictions, sign_flip_p, world


def test_p_is_that_of_scipys_permutation_test() -> None:
    rng = np.random.default_rng(11)
    for shift in (0.0, 0.3, 0.6):
        gaps = rng.normal(shift, 1, 30)
        expected = permutation_p(gaps, n_resamples=9_999)
        p = sign_flip_p(gaps[:, None], rng=np.random.default_rng(1))[0]
        assert p == pytest.approx(expected, abs=0.015)


def test_smallest_p_is_that_of_no_flip_as_large() -> None:
    assert LEAST_P == 1 / (N_SIGN_FLIPS + 1)


# --- the interval ----------------------------------------------------------------------------------------


def by_a_loop(gaps: Floats, counts: Floats, *, seed: int, n_flips: int) -> tuple[float, float, float]:
    """p, low and high of one column, one vector of signs after the other; all are integers."""
    signs = np.random.default_rng(seed).integers(0, 2, (n_flips, len(gaps)), dtype=np.int8)
    n_as_large = 0
    lows: list[float] = []
    highs: list[float] = []
    for row in signs:
        plus, minus = row == 1, row == 0
        n_as_large += abs(gaps[plus].sum() - gaps[minus].sum()) >= abs(gaps.sum())
        if not counts[plus].sum() or not counts[minus].sum():
            lows, highs = [*lows, -np.inf], [*highs, np.inf]
            continue
        means = gaps[plus].sum() / counts[plus].sum(), gaps[minus].sum() / counts[minus].sum()
        lows, highs = [*lows, min(means)], [*highs, max(means)]
    allowed = [k for k in range(n_flips + 1) if (1 + k) / (n_flips + 1) >= 0.05]
    low, high = sorted(lows)[allowed[0] - 1], sorted(highs, reverse=True)[allowed[0] - 1]
    return (1 + n_as_large) / (n_flips + 1), low, high


@pytest.mark.parametrize("n_flips", [199, 999])
@pytest.mark.parametrize("shift", [0, 2, 6])
def test_p_and_interval_are_those_of_a_plain_loop(shift: int, n_flips: int) -> None:
    rng = np.random.default_rng([shift, n_flips])
    counts = rng.integers(0, 30, (24, 3)).astype(float)
    counts[:9, 2] = 0
    gaps = rng.integers(-90 + shift * 5, 100 + shift * 5, counts.shape) * (counts > 0)
    flipped = sign_flips(gaps.astype(float), counts, rng=np.random.default_rng(7), n_flips=n_flips)
    for column in range(3):
        p, low, high = by_a_loop(gaps[:, column], counts[:, column], seed=7, n_flips=n_flips)
        assert flipped.p[column] == p
        assert (flipped.low[column], flipped.high[column]) == (low, high)


def some_gaps(kind: str, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Differences and counts, (recordings, 40 columns), near the border of what is significant."""
    n_bags = int(rng.choice([8, 12, 20, 35, 80]))
    counts = rng.integers(0 if kind == "holes" else 1, 40, (n_bags, 40)).astype(float)
    shift = rng.normal(0, 2.2, 40) / n_bags**0.5
    if kind == "integers":
        return np.round(rng.normal(0, 1.5, counts.shape) + shift), counts
    if kind == "alike":
        return np.where(rng.random(counts.shape) < 0.8, 0, rng.normal(0, 1, counts.shape) + 2 * shift), counts
    if kind == "constant":
        return shift * counts, counts
    if kind == "tenths":  # sums that are equal but for their rounding
        return np.round(rng.normal(0, 3, counts.shape) + 3 * shift) / 10, counts
    return (rng.standard_t(2, counts.shape) + shift) * counts, counts


@pytest.mark.parametrize("kind", ["integers", "alike", "constant", "tenths", "holes", "heavy"])
def test_0_is_outside_the_interval_exactly_where_p_is_below_5_percent(kind: str) -> None:
    n_significant = n_not = 0
    for seed in range(6):
        gaps, counts = some_gaps(kind, np.random.default_rng([seed, len(kind)]))
        for n_flips in (499, 1_999):
            flipped = sign_flips(gaps, counts, rng=np.random.default_rng(seed), n_flips=n_flips)
            is_outside = (flipped.low > 0) | (flipped.high < 0)
            assert (is_outside == (flipped.p < 0.05)).all()
            p = sign_flip_p(gaps, rng=np.random.default_rng(seed), n_flips=n_flips)
            assert (p == flipped.p).all(), "whatever the counts are"
            n_significant += int(is_outside.sum())
            n_not += int((~is_outside).sum())
    assert n_significant >= 10
    assert n_not >= 10 or kind == "constant"


def test_the_interval_holds_exactly_what_the_same_test_does_not_reject() -> None:
    gaps, counts = some_gaps("integers", np.random.default_rng(5))
    gaps, counts = gaps[:, :1], counts[:, :1]
    flipped = sign_flips(gaps, counts, rng=np.random.default_rng(0))
    for end, outwards in ((flipped.low[0], -1), (flipped.high[0], 1)):
        for step, is_inside in ((1e-6, False), (-1e-6, True)):
            shifted = gaps - (end + outwards * step) * counts
            p = sign_flip_p(shifted, rng=np.random.default_rng(0))[0]
            assert (p >= 0.05) == is_inside


def test_few_recordings_exclude_no_difference() -> None:
    gaps = np.array([[3.0], [4.0], [5.0], [6.0]])
    flipped = sign_flips(gaps, np.ones_like(gaps), rng=np.random.default_rng(0))
    assert (flipped.low[0], flipped.high[0]) == (-np.inf, np.inf)
    assert flipped.p[0] > 0.05
    nothing = sign_flips(np.zeros((30, 1)), np.zeros((30, 1)), rng=np.random.default_rng(0))
    assert (nothing.p[0], nothing.low[0], nothing.high[0]) == (1.0, -np.inf, np.inf)


# --- as it is published ----------------------------------------------------------------------------------


@pytest.mark.slow
@settings(max_examples=300)
@given(
    first=st.floats(0, 50),
    gap=st.floats(-3, 3),
    below=st.floats(0, 3),
    above=st.floats(0, 3),
    decimals=st.integers(1, 2),
    scale=st.sampled_from([1.0, 0.01]),
)
def test_what_is_published_says_the_same_of_0_as_p(
    first: float, gap: float, below: float, above: float, decimals: int, scale: float
) -> None:
    gap, low, high = scale * gap, scale * (gap - below), scale * (gap + above)
    p = 0.0496 if low > 0 or high < 0 else 0.05
    rounded = rounded_difference(
        Difference(gap, low, high, p), first=first + gap, second=first, decimals=decimals
    )
    assert rounded.low <= rounded.difference <= rounded.high
    assert rounded.is_significant == (rounded.low > 0 or rounded.high < 0)
    assert rounded.difference == pytest.approx(round(first + gap, decimals) - round(first, decimals))
    if rounded.difference == 0:
        assert (rounded.p, rounded.p_below) == (1.0, 1.0)
    else:
        assert (rounded.p, rounded.p_below) == (p, 0.05 if p < 0.05 else 1.0)
        assert abs(rounded.low - low) <= 10**-decimals + 1e-9 or rounded.low == rounded.difference
        assert abs(rounded.high - high) <= 10**-decimals + 1e-9 or rounded.high == rounded.difference


def test_a_detectable_difference_is_significant_four_times_in_five() -> None:
    rng = np.random.default_rng(4)
    counts = np.full((100, 200), 10.0)
    noise = 10 * rng.normal(0, 1, counts.shape)
    flipped = sign_flips(noise, counts, rng=rng, n_flips=999)
    detectable = [
        Difference(0.0, low, high, 1.0).detectable_difference
        for low, high in zip(flipped.low, flipped.high, strict=True)
    ]
    shift = float(np.mean([value for value in detectable if value is not None]))
    again = 10 * rng.normal(shift, 1, counts.shape)
    assert (sign_flip_p(again, rng=rng, n_flips=999) < 0.05).mean() == pytest.approx(0.8, abs=0.08)
    assert Difference(0.0, None, None, None).detectable_difference is None


# --- two files -------------------------------------------------------------------------------------------


def test_comparing_two_files_is_paired_symmetric_and_repeatable() -> None:
    truth = world(12)
    first, second = predictions(truth, 1), predictions(truth, 2, noise=0.3)
    differences = compare_predictions(first, second, truth, decimals=None)
    assert differences == compare_predictions(first, second, truth, decimals=None)
    means = [evaluate(each, truth).flat() for each in (first, second)]
    turned = compare_predictions(second, first, truth, decimals=None)
    for name, gap in differences.items():
        assert gap.difference == pytest.approx(means[0][name] - means[1][name], rel=1e-9)
        assert (gap.low is None) == (gap.p is None) == (gap.n_effective < 8)
        if gap.p is not None:
            assert gap.low <= gap.difference <= gap.high
            assert turned[name].turned() == gap
    own = [confidence_intervals(each, truth)["mid"] or (0.0, 0.0) for each in (first, second)]
    assert differences["mid"].high - differences["mid"].low < sum(high - low for low, high in own)


def test_two_files_are_compared_as_a_board_publishes_it() -> None:
    truth = world(12)
    first, second = predictions(truth, 1), predictions(truth, 2, noise=0.3)
    exact = compare_predictions(first, second, truth, decimals=None)
    means = [evaluate(each, truth).flat() for each in (first, second)]
    for name, gap in compare_predictions(first, second, truth).items():
        assert gap == rounded_difference(exact[name], first=means[0][name], second=means[1][name], decimals=2)
    same = compare_predictions(first, first, truth)["mid"]
    assert (same.difference, same.low, same.high, same.p) == (0, None, None, None)
    assert same.n_different == 0
    assert not same.is_significant


@pytest.mark.parametrize("n_different", [0, 1, 5, 6])
def test_methods_are_tested_only_where_they_differ_in_six_units(n_different: int) -> None:
    counts = np.full((40, 1), 10.0)
    second = np.full((40, 1), 100.0)
    first = second.copy()
    first[:n_different] += 50.0
    gap = difference(first, second, counts, names=["mid"], signs=np.random.default_rng(0))["mid"]
    assert (gap.n_different, gap.n_units) == (n_different, 40)
    is_tested = n_different >= 6
    assert [each is not None for each in (gap.low, gap.high, gap.p, gap.p_below)] == [is_tested] * 4
    assert (gap.resolution is not None) == is_tested
    assert gap.why_untested == (
        ""
        if is_tested
        else f"the methods differ in {n_different} of 40 recordings, too few to test (at least 6 needed)"
    )


def test_a_difference_of_summing_order_is_none() -> None:
    counts = np.full((40, 1), 3.0)
    first, second = np.full((40, 1), 0.1 + 0.2 + 0.3), np.full((40, 1), 0.3 + 0.2 + 0.1)
    assert (first != second).any()
    gap = difference(first, second, counts, names=["mid"], signs=np.random.default_rng(0))["mid"]
    assert (gap.n_different, gap.p) == (0, None)
