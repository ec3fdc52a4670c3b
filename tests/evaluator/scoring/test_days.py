"""Where recordings of one day are alike, days as units hold what recordings as units do not."""

import numpy as np
import pytest

from evaluator.scoring.dependence import dependence
from evaluator.scoring.uncertainty import usable_columns
from evaluator.units import units_of
from tests.days import World, coverage


def found_in(world: World, *, n: int = 60) -> tuple[float, float, float]:
    """Median SE factor, median correlation, and how often it is found at 5 %."""
    rng = np.random.default_rng([world.n_recordings, int(100 * world.rho)])
    sums, counts = world.draw(n, rng, n_methods=1)
    each = [dependence(sums[0, :, i], counts[:, i], world.days, rng=rng, n=199) for i in range(n)]
    known = [found for found in each if found is not None]
    assert len(known) == n
    return (
        float(np.median([found.se_factor for found in known])),
        float(np.median([found.correlation for found in known])),
        float(np.mean([found.p <= 0.05 for found in known])),
    )


@pytest.mark.slow
def test_intervals_and_ranges_of_days_hold_where_those_of_recordings_do_not() -> None:
    # 40 days of 10 recordings; ± 5 to 10.
    found = coverage(World(400, 10, 0.2), n=100, rng=np.random.default_rng(4))
    recordings, days = found["recordings"], found["days"]
    assert recordings.of_mean < 0.89
    assert recordings.of_difference < 0.89
    assert recordings.of_all_ranges < 0.70
    assert days.of_mean > 0.90
    assert days.of_difference > 0.91
    assert days.of_all_ranges > 0.90


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rho", "factor", "correlation", "is_found"),
    [(0.0, 0.97, 0.0, (0.0, 0.13)), (0.1, 1.10, 0.06, (0.1, 0.5)), (0.4, 1.42, 0.31, (0.8, 1.0))],
)
def test_the_factor_of_150_recordings_5_a_day_is_that_of_the_review(
    rho: float, factor: float, correlation: float, is_found: tuple[float, float]
) -> None:
    se_factor, found, share = found_in(World(150, 5, rho))
    assert se_factor == pytest.approx(factor, abs=0.08)
    assert found == pytest.approx(correlation, abs=0.05)
    assert is_found[0] <= share <= is_found[1]


def test_the_factor_is_that_of_a_plain_loop() -> None:
    world = World(30, 3, 0.3)
    rng = np.random.default_rng(8)
    sums, counts = (each[..., 0] for each in world.draw(1, rng, n_methods=1))
    found = dependence(sums[0], counts, world.days, rng=rng)
    assert found is not None
    rests = sums[0] - sums[0].sum() / counts.sum() * counts
    by_day = [range(3 * day, 3 * day + 3) for day in range(10)]
    square = sum(u**2 for u in rests)
    pairs = [(g, h) for day in by_day for g in day for h in day if g != h]
    products, sizes = sum(rests[g] * rests[h] for g, h in pairs), sum(counts[g] * counts[h] for g, h in pairs)
    assert found.se_factor == pytest.approx((sum(rests[list(d)].sum() ** 2 for d in by_day) / square) ** 0.5)
    assert found.correlation == pytest.approx(products / sizes / (square / (counts**2).sum()))


def test_where_every_unit_is_one_recording_or_nothing_differs_there_is_no_factor() -> None:
    rng = np.random.default_rng(1)
    counts = np.full(12, 5.0)
    alone = units_of([f"r{i}" for i in range(12)], given={f"r{i}": f"u{i}" for i in range(12)})
    assert dependence(rng.uniform(size=12), counts, alone, rng=rng) is None
    pairs = units_of([f"r{i:02d}" for i in range(12)], given={f"r{i:02d}": f"u{i // 2}" for i in range(12)})
    assert dependence(counts * 3, counts, pairs, rng=rng) is None
    assert dependence(counts * 0, counts * 0, pairs, rng=rng) is None


def test_seven_days_are_too_few_for_an_interval() -> None:
    counts = np.full((7, 1), 100.0)
    assert not usable_columns(counts).any()
    assert usable_columns(np.full((8, 1), 100.0)).all()
