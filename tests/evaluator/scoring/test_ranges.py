"""Rank ranges, quoted rows among them, against plain loops, and what must not change them."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from evaluator.scoring import ranges
from evaluator.scoring.balance import tangents
from evaluator.scoring.ranges import Quoted, rank_ranges
from tests.evaluator.recordings import N_BAGS, Floats, sign_flip_p, some_sums

Papers = list[tuple[float, float]]


def quoted_of(papers: Papers, counts: Floats) -> Quoted:
    """Rows of papers by value and half width."""
    values, half_widths = np.array(papers).T
    return Quoted(values[:, None], half_widths[:, None], counts)


def ranges_of(sums: Floats, counts: Floats, papers: Papers | None = None) -> list[tuple[int, int, bool]]:
    """Low, high and whether it is with the best, of the only column."""
    published = np.round(sums.sum(axis=1) / counts.sum(axis=0), 2)
    computed = rank_ranges(
        sums,
        published=published,
        usable=np.ones(1, dtype=bool),
        rng=np.random.default_rng(5),
        quoted=quoted_of(papers, counts) if papers else None,
    )
    columns = (computed.low[:, 0], computed.high[:, 0], computed.is_with_best[:, 0])
    return [(int(a), int(b), bool(c)) for a, b, c in zip(*columns, strict=True)]


def rarity_of(gaps: Floats, level: float) -> tuple[float, float]:
    """Slope and offset of a pair's statistic, one pair at a time."""
    squares = gaps[None] ** 2
    tangent = tangents(squares, squares.sum(axis=1), (squares**2).sum(axis=1), level=level, noise=np.zeros(1))
    return float(tangent.slope[0]), float(tangent.offset[0])


def margin_of(sums: Floats, counts: Floats) -> float:
    """Half a 95% interval of an entry's total, by its residuals."""
    residuals = sums - sums.sum() / counts.sum() * counts
    return float(1.959964 * np.sqrt((residuals**2).sum()))


def ranges_of_a_loop(
    sums: Floats, counts: Floats, papers: Papers | None = None, *, n_steps: int = 100
) -> list[tuple[int, int, bool]]:
    """Step-down over all ordered pairs, one after the other, as the papers have it.

    A quoted row counts with its lower end where it may be worse, with its upper end where it may be better,
    and with an interval as wide as that of the entry; two quoted rows are no pair.
    """
    values = np.round(sums.sum(axis=1) / counts.sum(axis=0), 2)[:, 0]
    names = [*range(len(sums)), *(f"paper {i}" for i in range(len(papers or [])))]
    shape = (ranges.N_RANK_FLIPS, N_BAGS)
    signs = np.random.default_rng(5).integers(0, 2, shape, dtype=np.int8) * 2.0 - 1

    def end(name: object, sign: int) -> tuple[float, Floats]:
        if isinstance(name, int):
            return values[name], sums[name][:, 0]
        value, half = (papers or [])[names.index(name) - len(sums)]
        return value + sign * half, (value + sign * half) * counts[:, 0]

    pairs = [
        (worse, better)
        for worse, better in itertools.permutations(names, 2)
        if isinstance(worse, int) or isinstance(better, int)
    ]
    level = float(stats.norm.isf(0.05 / len(pairs)))
    observed, draws = {}, {}
    for worse, better in pairs:
        (value, own), (other_value, other) = end(worse, -1), end(better, 1)
        gaps = own - other
        slope, offset = rarity_of(gaps, level) if (gaps != 0).sum() >= 6 else (0.0, 0.0)
        entries = [name for name in (worse, better) if isinstance(name, int)]
        total = gaps.sum() - (margin_of(sums[entries[0]], counts) if len(entries) == 1 else 0)
        is_worse = value > other_value and total > 0
        observed[worse, better] = slope * total + offset if is_worse else 0.0
        draws[worse, better] = slope * (signs @ gaps) + offset
    family, rejected = set(observed), set()
    for _ in range(n_steps):
        largest = np.max([draws[pair] for pair in family], axis=0)
        critical = np.quantile(largest, 0.95, method="higher")
        newly_rejected = {pair for pair in family if observed[pair] > critical}
        if not newly_rejected:
            break
        rejected |= newly_rejected
        family -= newly_rejected
    lows = [1 + sum((own, other) in rejected for other in names) for own in range(len(sums))]
    highs = [len(names) - sum((other, own) in rejected for other in names) for own in range(len(sums))]
    return [(low, high, low == 1) for low, high in zip(lows, highs, strict=True)]


@pytest.mark.parametrize("step", [0.0, 0.3, 0.6, 2.0])
@pytest.mark.parametrize(
    "papers", [[], [(20.0, 0.05)], [(18.2, 0.05), (20.3, 0.05), (20.3, 0.005), (21.5, 0.5)], [(20.0, 0.0)]]
)
def test_rank_ranges_are_those_of_a_plain_loop(step: float, papers: Papers) -> None:
    sums, counts = some_sums(20, n_entries=7, step=step)
    assert ranges_of(sums, counts, papers) == ranges_of_a_loop(sums, counts, papers)


def one_dominates(seed: int, *, n_recordings: int = 150, n_dominating: int = 1) -> tuple[Floats, Floats]:
    """Sums of three methods; the first fails in some recordings, and is worse in all others as well."""
    rng = np.random.default_rng(seed)
    counts = rng.integers(10, 60, (n_recordings, 1)).astype(float)
    errors = rng.lognormal(0, 0.3, (3, n_recordings, 1)) * np.array([1.4, 1.0, 1.0])[:, None, None]
    errors[0, :n_dominating] *= 60
    return errors * counts, counts


@pytest.mark.parametrize("n_dominating", [1, 2, 4])
@pytest.mark.parametrize("seed", range(3))
def test_a_method_that_is_worse_everywhere_is_worse_where_few_recordings_have_most_of_its_error(
    seed: int, n_dominating: int
) -> None:
    sums, counts = one_dominates(seed, n_dominating=n_dominating)
    gaps = sums[0] - sums[1]
    t = float(gaps.sum() / np.sqrt((gaps**2).sum()))
    p = float(sign_flip_p(gaps, rng=np.random.default_rng(1))[0])
    # The largest t that a pair with few dominating recordings can have is below every bound of several pairs.
    assert t < 1.2 + n_dominating**0.5
    assert p <= 0.0001 or n_dominating > 1
    published = sums.sum(axis=1) / counts.sum(axis=0)
    for signs in range(6):
        computed = rank_ranges(
            sums, published=published, usable=np.ones(1, dtype=bool), rng=np.random.default_rng(signs)
        )
        assert (computed.low[0, 0], computed.high[0, 0]) == (3, 3)


def test_one_pair_with_dominating_recordings_takes_nothing_from_the_others() -> None:
    """Their ranges are those of a board without that method, but for its rank."""
    sums, counts = some_sums(26, n_entries=6, step=0.8)
    alone = ranges_of(sums, counts)
    failing = sums[-1:] * 1.3
    failing[0, 0] += 1e4 * counts[0]
    with_failing = ranges_of(np.concatenate([sums, failing]), counts)
    assert with_failing[-1][:2] == (7, 7)
    assert with_failing[:-1] == alone


def test_a_difference_that_is_only_as_rare_as_the_bound_is_not_significant() -> None:
    """Eight recordings, all differences alike: the observed sums are among the flipped ones."""
    counts = np.ones((8, 1))
    sums = np.arange(12.0)[:, None, None] * counts
    published = np.arange(12.0)[:, None]
    for seed in range(5):
        computed = rank_ranges(
            sums, published=published, usable=np.ones(1, dtype=bool), rng=np.random.default_rng(seed)
        )
        flips = (
            np.random.default_rng(seed).integers(0, 2, (ranges.N_RANK_FLIPS, 8), dtype=np.int8).sum(axis=1)
        )
        is_rare = np.mean((flips == 0) | (flips == 8)) <= 0.05
        assert bool((computed.low == computed.high).all()) == is_rare


@pytest.mark.parametrize("n_different", [5, 6])
def test_pairs_that_differ_in_fewer_than_six_recordings_are_never_distinguished(n_different: int) -> None:
    counts = np.ones((40, 1))
    first = 20 * counts
    second = first.copy()
    second[:n_different] += 100
    assert ranges_of(np.stack([first, second]), counts) == (
        [(1, 2, True)] * 2 if n_different == 5 else [(1, 1, True), (2, 2, False)]
    )


def test_an_entry_with_an_error_in_few_recordings_is_not_tested_against_a_paper() -> None:
    counts = np.ones((40, 1))
    for n_failing, expected in ((0, (1, 2, True)), (5, (1, 2, True)), (6, (1, 1, True))):
        sums = np.zeros((1, 40, 1))
        sums[0, :n_failing] = 0.01
        assert ranges_of(sums, counts, [(3.0, 0.05)]) == [expected]


def test_a_quoted_row_is_above_or_below_only_with_its_whole_rounding_interval() -> None:
    sums, counts = some_sums(22, n_entries=1)
    # The same error everywhere but for a trace: published as 20.06, and known to a thousandth.
    sums = 20.06 * counts + 1e-4 * (sums - sums.sum() / counts.sum() * counts)
    assert ranges_of(sums, counts, [(20.0, 0.05)]) == [(2, 2, False)]
    assert ranges_of(sums, counts, [(20.1, 0.05)]) == [(1, 2, True)]
    assert ranges_of(sums, counts, [(20.1, 0.005)]) == [(1, 1, True)]
    assert ranges_of(sums, counts, [(20.0, 0.5)]) == [(1, 2, True)]


def test_a_quoted_row_decides_a_rank_only_beyond_an_interval_as_wide_as_the_entrys() -> None:
    """Of two papers, both beyond what the entry alone would need, one is within the sum of both intervals."""
    sums, counts = some_sums(27, n_entries=1)
    mean, half = float(sums.sum() / counts.sum()), margin_of(sums[0], counts) / float(counts.sum())
    for sign, ranks in ((1, (1, 2, True)), (-1, (2, 3, False))):
        near, far = mean + sign * 1.8 * half, mean + sign * 3.5 * half
        alone = (1, 1, True) if sign > 0 else (2, 2, False)
        assert ranges_of(sums, counts, [(near, 0.0)]) == [(1, 2, True)]
        assert ranges_of(sums, counts, [(far, 0.0)]) == [alone]
        assert ranges_of(sums, counts, [(near, 0.0), (far, 0.0)]) == [ranks]


def test_two_quoted_rows_count_as_two_and_are_never_compared() -> None:
    sums, counts = some_sums(21, n_entries=1)
    assert ranges_of(sums, counts, [(1.0, 0.05), (2.0, 0.05)]) == [(3, 3, False)]
    assert ranges_of(sums, counts, [(1.0, 0.05), (900.0, 0.05)]) == [(2, 2, False)]
    absent = [(float("nan"), float("nan")), (900.0, 0.05)]
    assert ranges_of(sums, counts, absent) == [(1, 1, True)]


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    step=st.sampled_from([0.0, 0.3, 1.0]),
    tenths=st.lists(st.integers(180, 230), min_size=1, max_size=5),
)
def test_a_boards_rank_lies_in_its_range_among_quoted_rows(seed: int, step: float, tenths: list[int]) -> None:
    sums, counts = some_sums(seed, step=step)
    published = np.round(sums.sum(axis=1) / counts.sum(axis=0), 2)[:, 0]
    papers = [tenth / 10 for tenth in tenths]
    ranks = stats.rankdata([*published, *papers], method="min")[: len(sums)]
    for rank, (low, high, _) in zip(
        ranks, ranges_of(sums, counts, [(paper, 0.05) for paper in papers]), strict=True
    ):
        assert low <= rank <= high


def test_values_that_are_published_alike_are_never_distinguished() -> None:
    sums, counts = some_sums(24, n_entries=1)
    value = float(sums.sum() / counts.sum())
    nudged = sums + (0.003 if round(value + 0.003, 2) == round(value, 2) else -0.003) * counts
    assert ranges_of(np.concatenate([sums, nudged]), counts) == [(1, 2, True)] * 2


def test_who_lacks_a_value_has_no_range_and_is_in_nobodys() -> None:
    sums, counts = some_sums(25, n_entries=5, step=3.0)
    published = sums.sum(axis=1) / counts.sum(axis=0)
    published[2] = np.nan
    usable = np.ones(1, dtype=bool)
    computed = rank_ranges(sums, published=published, usable=usable, rng=np.random.default_rng(5))
    assert (computed.low[2, 0], computed.high[2, 0], bool(computed.is_with_best[2, 0])) == (0, 0, False)
    others = np.delete(sums, 2, axis=0)
    expected = rank_ranges(
        others, published=np.delete(published, 2, axis=0), usable=usable, rng=np.random.default_rng(5)
    )
    assert np.delete(computed.low, 2).tolist() == expected.low[:, 0].tolist()
    assert np.delete(computed.high, 2).tolist() == expected.high[:, 0].tolist()
    nobody = rank_ranges(sums, published=published * np.nan, usable=usable, rng=np.random.default_rng(5))
    assert not nobody.high.any()


@pytest.mark.slow
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
        computed = rank_ranges(sums, published=published, usable=usable, rng=np.random.default_rng(5))
        return [computed.low[:, 0].tolist(), computed.high[:, 0].tolist()]

    low, high = ranges(sums, published)
    assert ranges(sums[order], published[order]) == [[low[i] for i in order], [high[i] for i in order]]
    assert ranges(sums * 2.0**3, published * 2.0**3) == [low, high]
    ranks = stats.rankdata(published[:, 0], method="min")
    assert all(a <= rank <= b for a, rank, b in zip(low, ranks, high, strict=True))
    gaps = sums[0] - sums[1]
    p = sign_flip_p(np.concatenate([gaps, -gaps, gaps * scale], axis=1), rng=np.random.default_rng(1))
    assert p[0] == p[1] == p[2]
