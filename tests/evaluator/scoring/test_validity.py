"""Confidence intervals, tests and rank ranges hold; `python -m tests.validity` prints how well.

The repetitions are few, and the limits leave room for their chance; the command makes thousands.
"""

from collections.abc import Callable

import numpy as np
import pytest

from tests import error_models
from tests.error_models import Drawn, Model
from tests.validity import coverage, fields, margin, rare, worlds
from tests.validity.coverage import Coverage

# Cells in which no interval of this kind holds 95%: docs/validation.md gives their coverage.
SKEWED = {"Pareto", "unequal"}


def _simulated(model: Model, n_recordings: int) -> Coverage:
    rng = np.random.default_rng([n_recordings, *model.name.encode()])
    return coverage.coverage(model, n_recordings=n_recordings, n=200, n_resamples=1_000, n_flips=999, rng=rng)


@pytest.mark.parametrize("n_recordings", [20, 100])
@pytest.mark.parametrize("model", error_models.MODELS, ids=str)
def test_intervals_hold_the_truth_and_agree_with_p(model: Model, n_recordings: int) -> None:
    if model not in error_models.available():
        pytest.skip("KITTI: no shared/data/kitti-dev beside this checkout")
    simulated = _simulated(model, n_recordings)
    assert simulated.n_contradictions == 0
    worse = 0.81 if model.name == "informative" else 0.86 if model.name in SKEWED else 0.89
    assert min(simulated.all.of_means) >= worse
    if model.name != "informative":
        assert simulated.all.of_difference >= 0.91
        assert 0.02 <= simulated.all.below_5_percent <= 0.09


@pytest.mark.parametrize(
    "model", [m for m in error_models.MODELS if m.name == "informative"] + [error_models.ONE_FAILS], ids=str
)
def test_asymmetric_differences_are_called_significant_too_often(model: Model) -> None:
    """The limit that docs/uncertainty.md states: equal means by different routes break the symmetry."""
    few, many = _simulated(model, 50), _simulated(model, 700)
    assert few.all.below_5_percent > 0.08
    assert many.all.below_5_percent < few.all.below_5_percent


@pytest.mark.parametrize("model", [error_models.ONE_FAILS], ids=str)
def test_the_interval_of_the_method_that_fails_is_the_worse_one(model: Model) -> None:
    """The interval of the other method alone does not show it."""
    simulated = _simulated(model, 50)
    assert simulated.all.of_means[1] < 0.92 < simulated.all.of_means[0]
    assert 0.3 < simulated.share_shown < 0.6
    assert simulated.shown.n == round(200 * simulated.share_shown)


@pytest.mark.slow
def test_ranges_hold_beside_papers_that_measured_on_the_same_recordings() -> None:
    """With the papers' values as exact, all ranges held in two thirds of the cases."""
    share = fields.all_hold_beside_sampled_papers(
        n_methods=8, n_papers=2, n_recordings=40, correlation=0.0, n=200, rng=np.random.default_rng(1)
    )
    assert share >= 0.95 - 2 * margin(0.95, 200)


def test_a_test_of_single_sequences_is_wrong_most_of_the_time() -> None:
    rng = np.random.default_rng(1)
    assert coverage.by_sequences(0.2, n_recordings=100, n=100, rng=rng) > 0.4


@pytest.mark.slow
@pytest.mark.parametrize("field", fields.LEVELS)
@pytest.mark.parametrize("n_recordings", [100, 700])
def test_rank_ranges_hold_the_true_ranks(n_recordings: int, field: str) -> None:
    rng = np.random.default_rng([3, n_recordings])
    ranks = fields.ranks(
        fields.LEVELS[field],
        n_recordings=n_recordings,
        correlation=0.0,
        with_quoted_row=False,
        n=100,
        rng=rng,
    )
    assert ranks.each >= 0.95
    assert ranks.all_at_once >= 0.9


@pytest.mark.slow
@pytest.mark.parametrize("n_methods", [5, 10])
@pytest.mark.parametrize("correlation", [0.0, 0.9])
def test_all_rank_ranges_hold_at_once_beside_a_quoted_row(n_methods: int, correlation: float) -> None:
    rng = np.random.default_rng([4, n_methods, int(10 * correlation)])
    ranks = fields.ranks(
        (0.0,) * n_methods,
        n_recordings=100,
        correlation=correlation,
        with_quoted_row=True,
        n=100,
        rng=rng,
    )
    assert ranks.all_at_once >= 0.88 - margin(0.88, 100)


@pytest.mark.slow
@pytest.mark.parametrize("n_recordings", [40, 150])
def test_rank_ranges_hold_where_one_recording_has_most_of_each_methods_error(n_recordings: int) -> None:
    draw, rng = worlds.dominated(n_methods=6), np.random.default_rng([6, n_recordings])
    ranks = fields.ranks_of(draw, means=np.ones(6), n_recordings=n_recordings, n=200, rng=rng)
    assert ranks.all_at_once >= 0.95 - margin(0.95, 200)


def test_a_worse_method_is_rarely_marked_as_best_because_one_recording_has_most_of_its_error() -> None:
    """By a common bound of t, it was marked in 91% of cases."""
    draw, means = worlds.dominated(n_methods=3, worse=1.15), np.array([1.0, 1.0, 1.15])
    ranks = fields.ranks_of(draw, means=means, n_recordings=150, n=100, rng=np.random.default_rng(7))
    assert ranks.last_marked <= 0.3


@pytest.mark.parametrize("n_expected", [1, 3, 10, 40])
def test_of_rare_errors_little_is_claimed_and_what_is_claimed_holds(n_expected: int) -> None:
    """Of 1 expected error, the interval [0, 0] was shown in a third of all cases."""
    rng = np.random.default_rng([8, n_expected])
    result = rare.rare(n_expected, n_recordings=700, n=200, n_flips=999, n_resamples=500, rng=rng)
    assert (result.mean_shown < 0.2) == (n_expected <= 3)
    if n_expected >= 10:
        assert result.mean >= 0.95 - 2 * margin(0.95, 200)
        assert 0.65 <= result.power <= 0.9
    if n_expected > 1:
        assert result.difference >= 0.95 - 2 * margin(0.95, 100)


def test_recordings_of_alike_days_need_days_as_units() -> None:
    """35 recordings a day whose levels correlate by 0.2: by recordings, intervals are too narrow."""
    model = worlds.day_model(35, 0.2)

    def coverage_by(units: Callable[[Drawn], Drawn]) -> Coverage:
        rng = np.random.default_rng(5)
        return coverage.coverage(
            model, n_recordings=700, n=100, n_resamples=500, n_flips=499, rng=rng, units=units
        )

    recordings, days = coverage_by(coverage.as_drawn), coverage_by(coverage.days_of(35))
    assert recordings.all.of_difference < 0.8 < days.all.of_difference
    assert min(recordings.all.of_means) < 0.8 < min(days.all.of_means)
