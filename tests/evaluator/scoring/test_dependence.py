"""How alike recordings of one unit are, against a plain loop."""

import numpy as np
import pytest

from evaluator.scoring.dependence import dependence
from evaluator.scoring.uncertainty import usable_columns
from evaluator.units import units_of


def test_the_factor_is_that_of_a_plain_loop() -> None:
    rng = np.random.default_rng(8)
    counts = rng.integers(20, 60, 30).astype(float)
    sums = counts * (20 + np.repeat(rng.normal(0, 3, 10), 3) + rng.normal(0, 2, 30))
    days = units_of([f"r{i:02d}" for i in range(30)], given={f"r{i:02d}": f"d{i // 3}" for i in range(30)})
    effect = dependence(sums, counts, days, rng=rng)
    assert effect is not None
    assert effect.p < 0.05
    rests = sums - sums.sum() / counts.sum() * counts
    by_day = [range(3 * day, 3 * day + 3) for day in range(10)]
    square = sum(u**2 for u in rests)
    pairs = [(g, h) for day in by_day for g in day for h in day if g != h]
    products, sizes = sum(rests[g] * rests[h] for g, h in pairs), sum(counts[g] * counts[h] for g, h in pairs)
    assert effect.se_factor == pytest.approx((sum(rests[list(d)].sum() ** 2 for d in by_day) / square) ** 0.5)
    assert effect.correlation == pytest.approx(products / sizes / (square / (counts**2).sum()))


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
