"""The statistic of a pair says how rare a sum is among its own sign flips."""

import itertools

import numpy as np
import pytest
from scipy import optimize, stats

from evaluator.scoring.balance import tangents
from tests.evaluator.recordings import Floats


def statistic_of(gaps: Floats, level: float) -> tuple[float, float]:
    """Slope and offset of one pair with differences (G,)."""
    squares = gaps[None] ** 2
    tangent = tangents(squares, squares.sum(axis=1), (squares**2).sum(axis=1), level=level, noise=np.zeros(1))
    return float(tangent.slope[0]), float(tangent.offset[0])


def rate(gaps: Floats, total: float) -> float:
    """r of a sum, by a root and plain sums: r² / 2 = s T − Σ log cosh(s D)."""

    def slope(s: float) -> float:
        return float((gaps * np.tanh(s * gaps)).sum()) - total

    s = optimize.brentq(slope, 0, 1e3 / np.abs(gaps).max())
    return float(np.sqrt(2 * (s * total - (np.logaddexp(s * gaps, -s * gaps) - np.log(2)).sum())))


def with_dominating(*sizes: float, seed: int = 0) -> Floats:
    return np.concatenate([sizes, np.random.default_rng(seed).normal(0, 0.05, 60)])


@pytest.mark.parametrize("level", [2.0, 3.2, 4.7])
def test_a_sum_of_many_alike_has_its_t(level: float) -> None:
    gaps = np.random.default_rng(1).normal(0, 1, 5_000)
    slope, offset = statistic_of(gaps, level)
    assert slope * np.sqrt((gaps**2).sum()) == pytest.approx(1, abs=0.03)
    assert offset == pytest.approx(0, abs=0.03 * level)


@pytest.mark.parametrize("level", [2.5, 3.2, 4.2])
@pytest.mark.parametrize("sizes", [(1.0,), (-1.0,), (1.0, 0.6), (1.0, -1.0, 1.0), (0.3, 0.2, 0.2)])
def test_the_statistic_is_near_the_level_what_the_rate_of_large_deviations_says(
    sizes: tuple[float, ...], level: float
) -> None:
    gaps = with_dominating(*sizes)
    slope, offset = statistic_of(gaps, level)
    for wanted in (0.85 * level, level, 1.1 * level):
        total = (wanted - offset) / slope
        assert rate(gaps, total) == pytest.approx(wanted, rel=0.04)


@pytest.mark.slow
@pytest.mark.parametrize("sizes", [(1.0,), (1.0, 0.6), (1.0, 1.0, 1.0)])
def test_sums_with_one_statistic_are_about_as_rare_in_every_pair(sizes: tuple[float, ...]) -> None:
    """Of max-t they are not: where one recording dominates, t above 2 may never occur."""
    rng = np.random.default_rng(3)
    signs = rng.choice([-1.0, 1.0], (200_000, 60 + len(sizes)))
    level = 3.0
    gaps = with_dominating(*sizes)
    slope, offset = statistic_of(gaps, level)
    share = float((slope * (signs @ gaps) + offset >= level).mean())
    assert 0.4 <= share / stats.norm.sf(level) <= 2.5


def test_a_pairs_statistic_depends_on_no_other_pair() -> None:
    rng = np.random.default_rng(4)
    gaps = rng.standard_t(2, (20, 60))
    squares = gaps**2

    def statistics_of(chosen: list[int]) -> list[tuple[float, float]]:
        some = squares[chosen]
        each = tangents(some, some.sum(axis=1), (some**2).sum(axis=1), level=3.0, noise=np.zeros(len(chosen)))
        return list(zip(each.slope.tolist(), each.offset.tolist(), strict=True))

    together = statistics_of(list(range(20)))
    assert together == list(itertools.chain.from_iterable(statistics_of([i]) for i in range(20)))


def test_rounding_is_no_rarity() -> None:
    """Next to a large sum, a difference has few digits in float32: such a pair is judged as a normal one."""
    gaps = with_dominating(1.0)
    squares = gaps[None] ** 2
    tangent = tangents(
        squares, squares.sum(axis=1), (squares**2).sum(axis=1), level=3.0, noise=np.full(1, 100.0)
    )
    assert float(tangent.slope[0]) <= 1 / float(np.abs(gaps).max())
