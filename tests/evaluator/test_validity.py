"""Whether intervals, tests and rank ranges keep their promises; `python -m tests.validity` says how well.

Here few repetitions, with room for their own chance; the command makes thousands.
"""

import numpy as np
import pytest

from tests import validity

pytestmark = pytest.mark.slow

WORLDS = validity.worlds()


@pytest.mark.parametrize("world", WORLDS, ids=str)
def test_the_cluster_test_errs_as_often_as_it_says_and_a_test_of_sequences_does_not(
    world: validity.World,
) -> None:
    rng = np.random.default_rng([1, world.n_bags, int(100 * world.correlation)])
    errors = validity.errors_of_the_tests(world, n=500, n_flips=999, rng=rng)
    assert 0.03 <= errors.by_recording <= 0.08
    assert errors.by_sequence > 0.2


@pytest.mark.parametrize("world", WORLDS, ids=str)
def test_a_95_percent_interval_holds_the_truth_about_95_percent_of_the_time(world: validity.World) -> None:
    rng = np.random.default_rng([2, world.n_bags, int(100 * world.correlation)])
    coverage = validity.coverage_of_intervals(world, n=500, n_resamples=2_000, rng=rng)
    assert 0.92 <= coverage.of_mean <= 0.97
    assert 0.92 <= coverage.of_difference <= 0.97


@pytest.mark.parametrize("field", validity.LEVELS)
@pytest.mark.parametrize("world", WORLDS, ids=str)
def test_rank_ranges_hold_the_true_ranks(world: validity.World, field: str) -> None:
    rng = np.random.default_rng([3, world.n_bags, int(100 * world.correlation)])
    ranks = validity.coverage_of_ranks(world, validity.LEVELS[field], n=100, rng=rng)
    assert ranks.each >= 0.95
    assert ranks.all_at_once >= 0.9
