"""Intervals of means against plain loops and scipy, and what must not change them."""

import numpy as np
import pytest
from scipy import stats

from evaluator import SCORE_NAMES, confidence_intervals, evaluate
from evaluator.scoring import uncertainty
from evaluator.scoring.intervals import recording_sums
from evaluator.scoring.uncertainty import Bootstrap
from tests.evaluator.recordings import N_BAGS, Floats, predictions, some_sums, world

# --- sums ------------------------------------------------------------------------------------------------


def test_sums_per_recording_are_those_of_a_loop_and_add_up_to_the_report() -> None:
    truth = world(1)
    report = evaluate(predictions(truth, 2), truth, keep_sequences=True, keep_bags=True)
    assert report.sequences is not None
    expected, counts = np.zeros((2, N_BAGS, 10))
    ranges = {
        "": (-np.inf, np.inf),
        "crucial": (0, 3),
        "small": (3, 6),
        "large": (6, 20),
        "negative": (-20, 0),
    }
    for row, tau in enumerate(truth.ttc_s):
        for column, name in enumerate(SCORE_NAMES):
            metric, _, range_name = name.partition("_")
            low, high = ranges.get(range_name, (-np.inf, np.inf))
            if low <= tau <= high:
                expected[int(truth.manifest.bag_stamp[row]), column] += report.sequences[metric][row]
                counts[int(truth.manifest.bag_stamp[row]), column] += 1
    assert report.bags is not None
    assert report.bags.sums == pytest.approx(expected, rel=1e-12)
    assert (report.bags.counts == counts).all()
    means = report.bags.sums.sum(axis=0) / report.bags.counts.sum(axis=0)
    assert means == pytest.approx(list(report.flat().values()), rel=1e-12)


# --- intervals -------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_intervals_are_those_of_a_plain_loop_over_the_same_weights() -> None:
    truth = world(3)
    mine = predictions(truth, 4)
    bags = recording_sums(mine, truth)
    weights = uncertainty.generator_of(truth.digest, purpose="weights").standard_exponential(
        (10_000, N_BAGS), dtype=np.float32
    )
    intervals = confidence_intervals(mine, truth)
    for column, name in enumerate(SCORE_NAMES):
        counts = bags.counts[:, column]
        degrees = (counts**2).sum() ** 2 / (counts**4).sum() if counts.any() else 0
        if degrees < 8:
            assert intervals[name] is None
            continue
        means = [float(row @ bags.sums[:, column] / (row @ counts)) for row in weights]
        effective = counts.sum() ** 2 / (counts**2).sum()
        tail = stats.norm.cdf(-stats.t.ppf(0.975, degrees) * (effective / (effective - 1)) ** 0.5)
        assert intervals[name] == pytest.approx(np.quantile(means, [tail, 1 - tail]), rel=2e-4)


def test_intervals_agree_with_another_bootstrap_and_with_the_normal_distribution() -> None:
    sums, counts = some_sums(7, n_entries=2)
    bootstrap = Bootstrap(counts, rng=np.random.default_rng(0))
    low, high = bootstrap.intervals(sums)

    def mean(total: Floats, n: Floats, axis: int) -> Floats:
        return total.sum(axis=axis) / n.sum(axis=axis)

    other = stats.bootstrap(
        (sums[0, :, 0], counts[:, 0]),
        mean,
        paired=True,
        method="percentile",
        rng=np.random.default_rng(1),
    ).confidence_interval
    width = other.high - other.low
    assert [low[0, 0], high[0, 0]] == pytest.approx([other.low, other.high], abs=0.1 * width)
    theta = sums[0].sum() / counts.sum()
    error = float(np.sqrt(((sums[0] - theta * counts) ** 2).sum())) / counts.sum()
    assert high[0, 0] - low[0, 0] == pytest.approx(2 * 1.96 * error, rel=0.12)


def test_fewer_than_8_degrees_of_freedom_in_a_column_give_no_interval_there() -> None:
    counts = np.full((40, 3), 5.0)
    counts[8:, 1], counts[7:, 2] = 0, 0
    sums = (counts * np.random.default_rng(0).normal(20, 3, counts.shape))[None]
    bootstrap = Bootstrap(counts, rng=np.random.default_rng(0))
    low, high = bootstrap.intervals(sums)
    assert bootstrap.usable.tolist() == [True, True, False]
    assert (low[0, :2] < high[0, :2]).all()
    assert np.isnan([low[0, 2], high[0, 2]]).all()
    few = Bootstrap(counts[:7], rng=np.random.default_rng(0))
    assert np.isnan(few.intervals(sums[:, :7])).all()


def test_intervals_of_long_tailed_sizes_hold_the_mean() -> None:
    # 40 recordings of log-normal size; by the degrees of freedom of the mean it was 91 % of these.
    rng, n_worlds = np.random.default_rng(3), 600
    counts = np.round(np.clip(rng.lognormal(4, 1, (40, n_worlds)), 5, 500))
    sums = counts * (20 + 5 * rng.standard_t(4, counts.shape))
    bootstrap = Bootstrap(counts, rng=rng, n_resamples=2_000)
    low, high = (ends[0] for ends in bootstrap.intervals(sums[None]))
    assert bootstrap.usable.sum() > 200
    assert ((low <= 20) & (high >= 20))[bootstrap.usable].mean() >= 0.92


def test_an_interval_depends_on_its_own_entry_alone() -> None:
    sums, counts = some_sums(9, n_entries=11)
    bootstrap = Bootstrap(counts, rng=np.random.default_rng(0))
    low, high = bootstrap.intervals(sums)
    for i in range(len(sums)):
        own_low, own_high = bootstrap.intervals(sums[i : i + 1])
        assert (own_low[0, 0], own_high[0, 0]) == pytest.approx((low[i, 0], high[i, 0]), rel=1e-9)


@pytest.mark.parametrize("n_failing", [0, 1, 5, 6])
def test_a_mean_has_an_interval_with_an_error_in_at_least_six_units(n_failing: int) -> None:
    counts = np.full((40, 2), 10.0)
    sums = np.zeros((1, 40, 2))
    sums[0, :n_failing, 0] = 100.0
    sums[0, :, 1] = 100.0
    low, high = uncertainty.Bootstrap(counts, rng=np.random.default_rng(0), n_resamples=500).intervals(sums)
    assert bool(np.isfinite(low[0, 0])) == bool(np.isfinite(high[0, 0])) == (n_failing >= 6)
    assert np.isfinite(low[0, 1])
