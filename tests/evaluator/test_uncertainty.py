"""Intervals, tests and rank ranges against plain loops and scipy, and what must not change them."""

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

from evaluator import (
    SCORE_NAMES,
    GroundTruth,
    Predictions,
    compare_predictions,
    confidence_intervals,
    evaluate,
    uncertainty,
)
from evaluator.tables import Table
from evaluator.uncertainty import Bootstrap, rank_ranges, sign_flip_p

Floats = NDArray[np.float64]
N_BAGS = 40


def world(seed: int, *, n_bags: int = N_BAGS, per_bag: int = 6) -> GroundTruth:
    rng = np.random.default_rng(seed)
    n = n_bags * per_bag
    return GroundTruth.from_table(
        Table(
            anno_id=list(range(n)),
            bag_stamp=[f"{row % n_bags:04d}" for row in range(n)],
            cam_id=["1"] * n,
            ts_ns=[1_000 * row for row in range(n)],
            track_id=["1"] * n,
            ttc_s=(rng.uniform(0.5, 25, n) * rng.choice([1, 1, -1], n)).tolist(),
        )
    )


def predictions(truth: GroundTruth, seed: int, *, noise: float = 0.2) -> Predictions:
    rng = np.random.default_rng(seed)
    values = truth.ttc_s * rng.lognormal(0, noise, truth.n_sequences)
    return Predictions.from_arrays(ttc_s=values, manifest=truth.manifest)


def some_sums(seed: int, *, n_entries: int = 6, step: float = 0.5) -> tuple[Floats, Floats]:
    """Sums (entries, recordings, 1) and counts (recordings, 1) of entries that are ever a little worse."""
    rng = np.random.default_rng(seed)
    counts = rng.integers(1, 30, (N_BAGS, 1)).astype(float)
    errors = 20 + rng.normal(0, 3, (1, N_BAGS, 1)) + rng.normal(0, 1.5, (n_entries, N_BAGS, 1))
    return counts * (errors + step * np.arange(n_entries)[:, None, None]), counts


def ranges_of(sums: Floats, counts: Floats, **options: object) -> list[tuple[int, int, bool]]:
    """Low, high and whether it is with the best, of the only column."""
    published = np.round(sums.sum(axis=1) / counts.sum(axis=0), 2)
    found = rank_ranges(
        sums, published=published, usable=np.ones(1, dtype=bool), rng=np.random.default_rng(5), **options
    )
    columns = (found.low[:, 0], found.high[:, 0], found.is_with_best[:, 0])
    return [(int(a), int(b), bool(c)) for a, b, c in zip(*columns, strict=True)]


# --- sums ------------------------------------------------------------------------------------------------


def test_sums_per_recording_are_those_of_a_loop_and_add_up_to_the_report() -> None:
    truth = world(1)
    report = evaluate(predictions(truth, 2), truth, keep_sequences=True, keep_bags=True)
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
            metric, _, interval = name.partition("_")
            low, high = ranges.get(interval, (-np.inf, np.inf))
            if low <= tau <= high:
                expected[int(truth.manifest.bag_stamp[row]), column] += getattr(report.sequences, metric)[row]
                counts[int(truth.manifest.bag_stamp[row]), column] += 1
    assert report.bags is not None
    assert report.bags.sums == pytest.approx(expected, rel=1e-12)
    assert (report.bags.counts == counts).all()
    means = report.bags.sums.sum(axis=0) / report.bags.counts.sum(axis=0)
    assert means == pytest.approx(list(report.flat().values()), rel=1e-12)


# --- intervals -------------------------------------------------------------------------------------------


def test_intervals_are_those_of_a_plain_loop_over_the_same_weights() -> None:
    truth = world(3)
    mine = predictions(truth, 4)
    bags = uncertainty.bag_sums(mine, truth)
    weights = uncertainty.generator_of(truth.digest, purpose="weights").standard_exponential(
        (10_000, N_BAGS), dtype=np.float32
    )
    found = confidence_intervals(mine, truth)
    for column, name in enumerate(SCORE_NAMES):
        counts = bags.counts[:, column]
        if (counts > 0).sum() < 20:
            assert found[name] is None
            continue
        means = [float(row @ bags.sums[:, column] / (row @ counts)) for row in weights]
        effective = counts.sum() ** 2 / (counts**2).sum()
        tail = stats.norm.cdf(-stats.t.ppf(0.975, effective - 1) * (effective / (effective - 1)) ** 0.5)
        assert found[name] == pytest.approx(np.quantile(means, [tail, 1 - tail]), rel=2e-4)


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


@pytest.mark.parametrize("n", [20, 33, 67, 100, 300, 700, 10_000])
def test_the_tail_of_few_recordings_is_scipys(n: int) -> None:
    exact = stats.norm.cdf(-stats.t.ppf(0.975, n - 1) * (n / (n - 1)) ** 0.5)
    assert uncertainty._tail(n) == pytest.approx(exact, rel=2e-3)


def test_fewer_than_20_recordings_in_a_column_give_no_interval_there() -> None:
    sums, counts = some_sums(8, n_entries=1)
    sums, counts = np.repeat(sums, 2, axis=2), np.repeat(counts, 2, axis=1)
    sums[:, 19:, 1], counts[19:, 1] = 0, 0
    bootstrap = Bootstrap(counts, rng=np.random.default_rng(0))
    low, high = bootstrap.intervals(sums)
    assert bootstrap.usable.tolist() == [True, False]
    assert np.isnan([low[0, 1], high[0, 1]]).all()
    assert low[0, 0] < high[0, 0]
    few = Bootstrap(counts[:19], rng=np.random.default_rng(0))
    assert np.isnan(few.intervals(sums[:, :19])).all()


def test_an_interval_depends_on_its_own_entry_alone() -> None:
    sums, counts = some_sums(9, n_entries=11)
    bootstrap = Bootstrap(counts, rng=np.random.default_rng(0))
    low, high = bootstrap.intervals(sums)
    for i in range(len(sums)):
        own_low, own_high = bootstrap.intervals(sums[i : i + 1])
        assert (own_low[0, 0], own_high[0, 0]) == pytest.approx((low[i, 0], high[i, 0]), rel=1e-9)


# --- two entries -----------------------------------------------------------------------------------------


def test_p_is_that_of_scipys_permutation_test() -> None:
    rng = np.random.default_rng(11)
    for shift in (0.0, 0.3, 0.6):
        gaps = rng.normal(shift, 1, 30)
        expected = stats.permutation_test(
            (gaps,),
            lambda x, axis: x.sum(axis=axis),
            permutation_type="samples",
            n_resamples=9_999,
            vectorized=True,
            rng=np.random.default_rng(0),
        ).pvalue
        found = sign_flip_p(gaps[:, None], rng=np.random.default_rng(1))[0]
        assert found == pytest.approx(expected, abs=0.015)


def test_p_of_a_few_recordings_is_that_of_all_ways_to_turn_them() -> None:
    gaps = np.array([1.0, 2.0, -0.5, 3.0, 0.25, 1.0])
    turned = [abs(np.dot(signs, gaps)) for signs in itertools.product([-1, 1], repeat=6)]
    exact = np.mean(np.array(turned) >= abs(gaps.sum()) - 1e-12)
    assert sign_flip_p(gaps[:, None], rng=np.random.default_rng(2))[0] == pytest.approx(exact, abs=0.01)


def test_sums_that_differ_by_rounding_alone_count_as_equally_large() -> None:
    gaps = np.array([[0.1], [0.2], [0.3]] * 2 + [[0.0]] * 30)
    turned_over = sign_flip_p(gaps[::-1], rng=np.random.default_rng(2))[0]
    assert turned_over == pytest.approx(2 / 2**6, abs=0.006)
    assert sign_flip_p(np.zeros((25, 1)), rng=np.random.default_rng(2)).tolist() == [1.0]


def test_recordings_without_sequences_in_an_interval_change_nothing_of_its_p() -> None:
    gaps = np.random.default_rng(3).normal(0.4, 1, (30, 1))
    with_empty = np.concatenate([gaps, np.zeros((50, 1))])
    one, other = (sign_flip_p(each, rng=np.random.default_rng(4))[0] for each in (gaps, with_empty))
    assert one == pytest.approx(other, abs=0.01)


def test_comparing_two_files_is_paired_symmetric_and_repeatable() -> None:
    truth = world(12)
    first, second = predictions(truth, 1), predictions(truth, 2, noise=0.3)
    found = compare_predictions(first, second, truth)
    assert found == compare_predictions(first, second, truth)
    means = [evaluate(each, truth).flat() for each in (first, second)]
    turned = compare_predictions(second, first, truth)
    for name, gap in found.items():
        assert gap.difference == pytest.approx(means[0][name] - means[1][name], rel=1e-9)
        assert gap.p == turned[name].p
        if gap.p is not None:
            assert gap.low <= gap.difference <= gap.high
            assert (gap.low, gap.high) == pytest.approx((-turned[name].high, -turned[name].low), rel=1e-5)
    own = [confidence_intervals(each, truth)["mid"] or (0.0, 0.0) for each in (first, second)]
    assert found["mid"].high - found["mid"].low < sum(high - low for low, high in own)
    same = compare_predictions(first, first, truth)["mid"]
    assert (same.difference, same.low, same.high, same.p) == (0, 0, 0, 1)


def test_the_random_numbers_belong_to_the_revision_of_the_ground_truth() -> None:
    draw: Callable[[str, str], float] = lambda digest, purpose: uncertainty.generator_of(  # noqa: E731
        digest, purpose=purpose
    ).random()
    assert draw("sha256:a", "weights") == draw("sha256:a", "weights")
    assert len({draw(d, p) for d in ("sha256:a", "sha256:b") for p in ("weights", "signs")}) == 4


# --- rank ranges -----------------------------------------------------------------------------------------


def ranges_of_a_loop(sums: Floats, counts: Floats, *, n_steps: int = 100) -> list[tuple[int, int, bool]]:
    """Step-down max-t over all ordered pairs, one after the other, as the paper has it."""
    n_entries = len(sums)
    values = np.round(sums.sum(axis=1) / counts.sum(axis=0), 2)[:, 0]
    shape = (uncertainty.N_RANK_FLIPS, N_BAGS)
    signs = np.random.default_rng(5).integers(0, 2, shape, dtype=np.int8) * 2.0 - 1
    t, draws = {}, {}
    for worse, better in itertools.permutations(range(n_entries), 2):
        gaps = (sums[worse] - sums[better])[:, 0]
        error = float(np.sqrt((gaps**2).sum()))
        t[worse, better] = gaps.sum() / error if values[worse] > values[better] and error > 0 else 0.0
        draws[worse, better] = signs @ gaps / error if error > 0 else np.zeros(len(signs))
    family, rejected = set(t), set()
    for _ in range(n_steps):
        largest = np.max([draws[pair] for pair in family], axis=0)
        critical = np.quantile(largest, 0.95, method="higher")
        found = {pair for pair in family if t[pair] > critical}
        if not found:
            break
        rejected |= found
        family -= found
    best = int(np.argmin(values))
    return [
        (
            1 + sum((own, other) in rejected for other in range(n_entries)),
            n_entries - sum((other, own) in rejected for other in range(n_entries)),
            (own, best) not in rejected,
        )
        for own in range(n_entries)
    ]


@pytest.mark.parametrize("step", [0.0, 0.3, 0.6, 2.0])
def test_rank_ranges_are_those_of_a_plain_loop(step: float) -> None:
    sums, counts = some_sums(20, n_entries=7, step=step)
    assert ranges_of(sums, counts) == ranges_of_a_loop(sums, counts)


def test_stepping_down_finds_more_than_one_step_does() -> None:
    sums, counts = some_sums(31, n_entries=7, step=0.45)
    narrow, wide = ranges_of(sums, counts), ranges_of_a_loop(sums, counts, n_steps=1)
    assert all(a[0] >= b[0] and a[1] <= b[1] for a, b in zip(narrow, wide, strict=True))
    assert narrow != wide


def test_far_apart_entries_have_one_rank_and_equal_ones_share_all() -> None:
    sums, counts = some_sums(21, n_entries=4, step=10.0)
    assert ranges_of(sums, counts) == [(1, 1, True), (2, 2, False), (3, 3, False), (4, 4, False)]
    same = np.repeat(sums[:1], 4, axis=0)
    assert ranges_of(same, counts) == [(1, 4, True)] * 4
    assert ranges_of(sums[:1], counts) == [(1, 1, True)]


def test_an_entry_that_is_worse_by_the_same_amount_everywhere_is_surely_worse() -> None:
    sums, counts = some_sums(22, n_entries=1)
    shifted = np.concatenate([sums, sums + 0.5 * counts])
    assert ranges_of(shifted, counts) == [(1, 1, True), (2, 2, False)]


def test_values_that_are_published_alike_are_never_told_apart() -> None:
    sums, counts = some_sums(24, n_entries=1)
    value = float(sums.sum() / counts.sum())
    nudged = sums + (0.003 if round(value + 0.003, 2) == round(value, 2) else -0.003) * counts
    assert ranges_of(np.concatenate([sums, nudged]), counts) == [(1, 2, True)] * 2


def test_who_lacks_a_value_has_no_range_and_is_in_nobodys() -> None:
    sums, counts = some_sums(25, n_entries=5, step=3.0)
    published = sums.sum(axis=1) / counts.sum(axis=0)
    published[2] = np.nan
    usable = np.ones(1, dtype=bool)
    found = rank_ranges(sums, published=published, usable=usable, rng=np.random.default_rng(5))
    assert (found.low[2, 0], found.high[2, 0], bool(found.is_with_best[2, 0])) == (0, 0, False)
    others = np.delete(sums, 2, axis=0)
    expected = rank_ranges(
        others, published=np.delete(published, 2, axis=0), usable=usable, rng=np.random.default_rng(5)
    )
    assert np.delete(found.low, 2).tolist() == expected.low[:, 0].tolist()
    assert np.delete(found.high, 2).tolist() == expected.high[:, 0].tolist()
    nobody = rank_ranges(sums, published=published * np.nan, usable=usable, rng=np.random.default_rng(5))
    assert not nobody.high.any()


@settings(max_examples=25)
@given(
    seed=st.integers(0, 10_000),
    step=st.sampled_from([0.0, 0.3, 1.0]),
    order=st.permutations(range(6)),
    scale=st.floats(0.5, 100),
)
def test_ranges_and_p_do_not_depend_on_order_or_scale(
    seed: int, step: float, order: list[int], scale: float
) -> None:
    sums, counts = some_sums(seed, step=step)
    published = sums.sum(axis=1) / counts.sum(axis=0)
    usable = np.ones(1, dtype=bool)

    def ranges(sums: Floats, published: Floats) -> list[list[int]]:
        found = rank_ranges(sums, published=published, usable=usable, rng=np.random.default_rng(5))
        return [found.low[:, 0].tolist(), found.high[:, 0].tolist()]

    low, high = ranges(sums, published)
    assert ranges(sums[order], published[order]) == [[low[i] for i in order], [high[i] for i in order]]
    assert ranges(sums * 2.0**3, published * 2.0**3) == [low, high]
    ranks = stats.rankdata(published[:, 0], method="min")
    assert all(a <= rank <= b for a, rank, b in zip(low, ranks, high, strict=True))
    gaps = sums[0] - sums[1]
    p = sign_flip_p(np.concatenate([gaps, -gaps, gaps * scale], axis=1), rng=np.random.default_rng(1))
    assert p[0] == p[1] == p[2]


def test_pauses_are_made_in_every_column() -> None:
    sums, _ = some_sums(26)
    pauses: list[int] = []
    rank_ranges(
        np.repeat(sums, 3, axis=2),
        published=np.repeat(sums.sum(axis=1), 3, axis=1),
        usable=np.array([True, False, True]),
        rng=np.random.default_rng(0),
        between=lambda: pauses.append(1),
    )
    assert len(pauses) >= 2
