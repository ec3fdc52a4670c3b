"""Whether confidence intervals, tests and rank ranges hold; `python -m tests.validity` says how well.

Here few repetitions, with room for their own chance; the command makes thousands.
"""

import numpy as np
import pytest

from tests import error_models, validity
from tests.error_models import Model
from tests.evaluator.recordings import sign_flip_p

pytestmark = pytest.mark.slow

# Cells in which no interval of this kind holds 95 %: docs/uncertainty.md gives their coverage.
SKEWED = {"Pareto", "unequal"}


def _found(model: Model, n_recordings: int) -> validity.Coverage:
    rng = np.random.default_rng([n_recordings, *model.name.encode()])
    return validity.coverage(model, n_recordings=n_recordings, n=200, n_resamples=1_000, n_flips=999, rng=rng)


@pytest.mark.parametrize("n_recordings", [20, 100])
@pytest.mark.parametrize("model", error_models.MODELS, ids=str)
def test_intervals_hold_the_truth_and_agree_with_p(model: Model, n_recordings: int) -> None:
    if model not in error_models.available():
        pytest.skip("KITTI: no shared/data/kitti-dev beside this checkout")
    found = _found(model, n_recordings)
    assert found.n_contradictions == 0
    assert found.of_mean >= (0.86 if model.name in SKEWED else 0.90)
    if model.name != "informative":
        assert found.of_difference >= 0.91
        assert 0.02 <= found.false_positives <= 0.09


@pytest.mark.parametrize(
    "model", [m for m in error_models.MODELS if m.name == "informative"] + [error_models.ONE_FAILS], ids=str
)
def test_asymmetric_differences_are_called_significant_too_often(model: Model) -> None:
    """The limit that docs/uncertainty.md states: equal means by different routes break the symmetry."""
    few, many = _found(model, 50), _found(model, 700)
    assert few.false_positives > 0.08
    assert many.false_positives < few.false_positives


def test_a_test_of_single_sequences_is_wrong_most_of_the_time() -> None:
    rng = np.random.default_rng(1)
    assert validity.by_sequences(0.2, n_recordings=100, n=100, rng=rng) > 0.4


def test_a_test_of_recordings_is_right_where_that_of_sequences_is_not() -> None:
    rng = np.random.default_rng(2)
    drawn = error_models.MODELS[0].draw(100, 400, rng)
    p = sign_flip_p(drawn.first - drawn.second, rng=rng, n_flips=999)
    assert 0.02 <= (p < 0.05).mean() <= 0.09


@pytest.mark.parametrize("field", validity.LEVELS)
@pytest.mark.parametrize("n_recordings", [100, 700])
def test_rank_ranges_hold_the_true_ranks(n_recordings: int, field: str) -> None:
    rng = np.random.default_rng([3, n_recordings])
    ranks = validity.ranks(
        validity.LEVELS[field],
        n_recordings=n_recordings,
        correlation=0.0,
        with_quoted_row=False,
        n=100,
        rng=rng,
    )
    assert ranks.each >= 0.95
    assert ranks.all_at_once >= 0.9


@pytest.mark.parametrize("n_methods", [5, 10])
@pytest.mark.parametrize("correlation", [0.0, 0.9])
def test_all_rank_ranges_hold_at_once_beside_a_quoted_row(n_methods: int, correlation: float) -> None:
    rng = np.random.default_rng([4, n_methods, int(10 * correlation)])
    ranks = validity.ranks(
        (0.0,) * n_methods,
        n_recordings=100,
        correlation=correlation,
        with_quoted_row=True,
        n=100,
        rng=rng,
    )
    assert ranks.all_at_once >= 0.88 - validity.margin(0.88, 100)
