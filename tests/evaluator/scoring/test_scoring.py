"""Protocols, intervals and counts: evaluate() on made-up sequences."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluator import PROTOCOLS, SCORE_NAMES, Rejected, evaluate, get_protocol
from evaluator.metrics.registry import MID, RTE
from evaluator.metrics.scale import scale_ratio_10hz
from evaluator.predictions.loading import Predictions
from evaluator.scoring.report import Report
from evaluator.truth.ground_truth import GroundTruth
from tests.evaluator.worlds import make_truth

every_protocol = pytest.mark.parametrize("protocol", PROTOCOLS)


def given_values(truth: GroundTruth, ttc_s: object) -> Predictions:
    return Predictions.from_arrays(ttc_s=ttc_s, manifest=truth.manifest)  # type: ignore[arg-type]


def scored(predicted_s: list[float], true_s: list[float], *, protocol: str = "tsttc-1") -> Report:
    truth = make_truth(true_s)
    return evaluate(given_values(truth, predicted_s), truth, protocol=protocol, keep_sequences=True)


def problems_of(predicted_s: list[float], *, protocol: str) -> list[tuple[str, str]]:
    with pytest.raises(Rejected) as rejected:
        scored(predicted_s, [4.0] * len(predicted_s), protocol=protocol)
    return [(problem.code, problem.where) for problem in rejected.value.problems]


# --- intervals -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("true_s", "names"),
    [
        (2.9999999999999996, {"crucial"}),
        (3.0, {"crucial", "small"}),
        (3.0000000000000004, {"small"}),
        (6.0, {"small", "large"}),
        (20.0, {"large"}),
        (20.000000000000004, set()),
        (-20.0, {"negative"}),
        (-20.000000000000004, set()),
        (-0.11, {"negative"}),
        (1e-9, {"crucial"}),
    ],
)
def test_a_sequence_counts_where_its_true_value_lies(true_s: float, names: set[str]) -> None:
    report = scored([5.0], [true_s])
    assert {n for n, s in report.scores.items() if s.count} == {"overall"} | names
    assert report.n_out_of_range == (0 if names else 1)


# --- truncation ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("predicted_s", "used_s", "boundary"),
    [
        (20.0, 20.0, None),
        (20.000000000000004, 20.0, "20"),
        (1e308, 20.0, "20"),
        (math.inf, 20.0, "20"),
        (-20.000000000000004, -20.0, "-20"),
        (-math.inf, -20.0, "-20"),
        (0.05, 0.05, None),
        (0.049999999999999996, 0.05, "0.05"),
        (5e-324, 0.05, "0.05"),
        (-0.15, -0.15, None),
        (-0.14999999999999997, -0.15, "-0.15"),
        (-5e-324, -0.15, "-0.15"),
        (-0.1, -0.15, "-0.15"),
    ],
)
def test_the_boards_protocol_truncates_to_the_nearest_boundary_of_the_same_sign(
    predicted_s: float, used_s: float, boundary: str | None
) -> None:
    report = scored([predicted_s], [4.0])
    assert report.sequences is not None
    assert report.sequences["mid"][0] == pytest.approx(float(MID.errors(used_s, 4.0)), rel=1e-12)
    assert report.sequences["rte"][0] == float(RTE.errors(used_s, 4.0))
    assert {name: n for name, n in report.truncated.items() if n} == ({boundary: 1} if boundary else {})
    assert list(report.truncated) == ["-20", "-0.15", "0.05", "20"]


near_zero = st.floats(-0.15, 0.05, exclude_min=True, exclude_max=True)
elsewhere = (st.floats(0.05) | st.floats(max_value=-0.15)).filter(lambda value: not math.isnan(value))


@pytest.mark.slow
@given(predicted_s=st.lists(elsewhere, min_size=1, max_size=20))
def test_all_protocols_agree_exactly_away_from_zero(predicted_s: list[float]) -> None:
    truth = make_truth(np.linspace(1, 19, len(predicted_s)))
    given_predictions = given_values(truth, predicted_s)
    board, warnings, toolkit = (
        evaluate(given_predictions, truth, protocol=name).flat() for name in ("tsttc-1", "tsttc-2", "toolkit")
    )
    assert board == toolkit == {name: warnings[name] for name in board}


@pytest.mark.slow
@given(predicted_s=st.lists(near_zero.filter(bool), min_size=1, max_size=20))
def test_the_boards_protocol_always_has_a_finite_result(predicted_s: list[float]) -> None:
    truth = make_truth(np.linspace(1, 19, len(predicted_s)))
    report = evaluate(given_values(truth, predicted_s), truth)
    assert all(math.isfinite(value) for value in report.flat().values() if value is not None)
    assert report.truncated["-0.15"] + report.truncated["0.05"] == len(predicted_s)


# --- forbidden values ------------------------------------------------------------------------------------


@every_protocol
@pytest.mark.parametrize(("value", "code"), [(0.0, "zero"), (-0.0, "zero"), (math.nan, "nan")])
def test_zero_and_nan_are_refused(protocol: str, value: float, code: str) -> None:
    assert problems_of([4.0, value], protocol=protocol) == [(code, "/1")]


@pytest.mark.parametrize("value", [-0.05, -0.0999999, -1e-9, -5e-324, 5e-324])
def test_the_toolkits_protocol_refuses_values_without_a_logarithm(value: float) -> None:
    assert problems_of([value], protocol="toolkit") == [("undefined-error", "/0")]


@given(value=near_zero.filter(bool))
def test_the_toolkits_protocol_refuses_exactly_where_the_ratio_is_not_positive_and_finite(
    value: float,
) -> None:
    defined = 0 < float(scale_ratio_10hz(value)) < math.inf
    if defined:
        assert scored([value], [4.0], protocol="toolkit").scores["overall"].count == 1
    else:
        assert problems_of([value], protocol="toolkit") == [("undefined-error", "/0")]


# --- the call --------------------------------------------------------------------------------------------


def test_an_unknown_protocol_is_an_error_of_the_caller() -> None:
    with pytest.raises(ValueError, match=rf"Unknown protocol 'x'; expected one of {', '.join(PROTOCOLS)}\."):
        scored([4.0], [4.0], protocol="x")


def test_predictions_for_another_manifest_are_an_error_of_the_caller() -> None:
    truth, other = make_truth([4.0, 5.0]), make_truth([4.0, 5.0], anno_ids=[7, 8])
    with pytest.raises(ValueError, match="another manifest"):
        evaluate(given_values(other, [4.0, 5.0]), truth)


def test_the_same_manifest_in_another_row_order_is_realigned() -> None:
    truth = make_truth([4.0, 8.0, 2.0])
    table = truth.to_table()
    for column in (table.anno_id, table.bag_stamp, table.cam_id, table.ts_ns, table.track_id, table.ttc_s):
        column.reverse()
    other = GroundTruth.from_table(table)
    assert other.digest == truth.digest
    expected = evaluate(given_values(truth, [5.0, 8.0, 3.0]), truth, keep_sequences=True)
    reordered = evaluate(given_values(other, [3.0, 8.0, 5.0]), truth, keep_sequences=True)
    assert reordered.scores == expected.scores
    assert reordered.sequences is not None
    assert expected.sequences is not None
    assert reordered.sequences["mid"].tolist() == expected.sequences["mid"].tolist()


def test_score_names_are_the_papers_columns() -> None:
    intervals = ("crucial", "small", "large", "negative")
    columns = ("mid", *(f"mid_{i}" for i in intervals), "rte", *(f"rte_{i}" for i in intervals))
    assert columns == SCORE_NAMES
    assert tuple(scored([4.0], [4.0]).flat()) == SCORE_NAMES


def test_a_protocol_of_ones_own_can_be_tried() -> None:
    truth = make_truth([4.0])
    strict = replace(get_protocol("toolkit"), name="strict", limit_s=2.0)
    report = evaluate(given_values(truth, [4.0]), truth, protocol=strict)
    assert report.protocol == "strict"
    assert report.scores["overall"].rte == 50.0
