"""What must hold for every metric, whatever it is."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluator import evaluate
from evaluator.metrics.protocol import known_metrics
from evaluator.metrics.registry import MID, RTE, WARNING, Metric
from evaluator.predictions.loading import Predictions
from tests.evaluator.worlds import errors_of_the_toolkit, make_truth, means_of_the_toolkit

every_metric = pytest.mark.parametrize("metric", known_metrics().values(), ids=list(known_metrics()))

RNG = np.random.default_rng(20230901)
TRUE_S = np.concatenate([RNG.uniform(0.3, 19, 60), RNG.uniform(-19, -0.3, 40)])
PREDICTED_S = TRUE_S * RNG.lognormal(0, 0.1, 100)

times = st.floats(0.2, 20) | st.floats(-20, -0.2)


@every_metric
def test_an_error_is_one_sequences_own(metric: Metric) -> None:
    errors = metric.errors(PREDICTED_S, TRUE_S)
    message = "a score is the mean of the sequences' errors, so a median is no metric: docs/extending.md"
    assert errors.shape == TRUE_S.shape, message
    alone = [float(metric.errors(p, t)) for p, t in zip(PREDICTED_S, TRUE_S, strict=True)]
    assert errors.tolist() == pytest.approx(alone, rel=1e-12, abs=0), message


@every_metric
def test_a_perfect_prediction_has_no_error(metric: Metric) -> None:
    assert metric.errors(TRUE_S, TRUE_S).tolist() == [0.0] * 100


@every_metric
def test_errors_are_finite_and_not_negative(metric: Metric) -> None:
    errors = metric.errors(PREDICTED_S, TRUE_S)
    assert np.isfinite(errors).all()
    assert (errors >= 0).all()
    assert (errors > 0).any()


@every_metric
def test_scalars_and_arrays_broadcast(metric: Metric) -> None:
    assert metric.errors(5.0, TRUE_S).tolist() == metric.errors(np.full(100, 5.0), TRUE_S).tolist()
    assert metric.errors(PREDICTED_S, 5.0).tolist() == metric.errors(PREDICTED_S, np.full(100, 5.0)).tolist()


@pytest.mark.slow
@every_metric
@given(true_s=times, nearer=st.floats(0.01, 0.2), farther=st.floats(0.25, 0.9))
def test_a_prediction_further_off_on_the_same_side_is_not_better(
    metric: Metric, true_s: float, nearer: float, farther: float
) -> None:
    for direction in (1, -1):
        near, far = true_s * (1 + direction * nearer), true_s * (1 + direction * farther)
        if min(near, far) > 0.15 or max(near, far) < -0.15:
            of_near, of_far = metric.errors(near, true_s), metric.errors(far, true_s)
            # The warning error knows two sides only.
            assert of_near <= of_far if metric is WARNING else of_near < of_far


@given(predicted_s=times, true_s=times)
def test_single_sequences_equal_the_toolkits_arithmetic(predicted_s: float, true_s: float) -> None:
    expected = errors_of_the_toolkit(predicted_s, true_s)
    for metric in (MID, RTE):
        error = float(metric.errors(predicted_s, true_s))
        assert error == pytest.approx(expected[metric.name], rel=1e-12, abs=0)


@pytest.mark.parametrize(
    ("predicted_s", "true_s", "error"),
    [
        (2.7, 1.0, 0.0),
        (2.71, 1.0, 100.0),
        (2.7, 2.71, 100.0),
        (-1.0, 1.0, 100.0),
        (-0.2, -0.2, 0.0),
        (0.05, -5.0, 100.0),
        (math.inf, 2.7, 100.0),
        (10.0, -10.0, 0.0),
    ],
)
def test_the_warning_error_is_100_on_the_wrong_side_of_the_threshold(
    predicted_s: float, true_s: float, error: float
) -> None:
    assert float(WARNING.errors(predicted_s, true_s)) == error
    assert math.isnan(WARNING.errors(math.nan, true_s))


def test_mid_keeps_its_accuracy_where_the_logarithms_cancel() -> None:
    # On processors where numpy's logarithm differs from the C library's in its last bit, this is where it
    # shows.
    true_s = RNG.uniform(0.3, 20, 50_000)
    predicted_s = true_s * (1 + RNG.normal(0, 1e-6, 50_000))
    expected = [
        errors_of_the_toolkit(p, t)["mid"] for p, t in zip(predicted_s.tolist(), true_s.tolist(), strict=True)
    ]
    mid = MID.errors(np.minimum(predicted_s, 20), true_s)
    np.testing.assert_allclose(mid, expected, rtol=1e-12, atol=0)


def test_mid_is_nan_where_the_scale_ratio_is_not_positive() -> None:
    assert math.isnan(MID.errors(-0.05, 3.0))


@pytest.mark.slow
@given(pairs=st.lists(st.tuples(times, times), min_size=1, max_size=40))
def test_reports_equal_a_plain_loop(pairs: list[tuple[float, float]]) -> None:
    predicted_s, true_s = zip(*pairs, strict=True)
    truth = make_truth(true_s)
    predictions = Predictions.from_arrays(ttc_s=predicted_s, manifest=truth.manifest)
    report = evaluate(predictions, truth, protocol="toolkit")
    for name, expected in means_of_the_toolkit(predicted_s, true_s).items():
        score = report.scores[name]
        assert score.count == expected["count"]
        assert score.mid == (None if score.count == 0 else pytest.approx(expected["mid"], rel=1e-12, abs=0))
        assert score.rte == (None if score.count == 0 else pytest.approx(expected["rte"], rel=1e-12, abs=0))
