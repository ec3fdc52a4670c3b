"""The numbers of the dataset's own toolkit, to a relative error of 1e-12."""

import json
from pathlib import Path
from typing import Any

import pytest

from evaluator import PROTOCOLS, GroundTruth, Report, evaluate, read_predictions, read_truth
from tests.evaluator.worlds import GOLDEN, flat, make_truth

VECTORS: dict[str, Any] = json.loads(GOLDEN.read_text(encoding="utf-8"))
# The board's protocol truncates near zero, the toolkit does not; all other cases hold for both.
CASES = [
    (case, protocol)
    for case in VECTORS["cases"]
    for protocol in PROTOCOLS
    if case != "extreme_values" or protocol == "toolkit"
]

ESTIMATORS = ("box-area", "box-height", "box-sqrt-area", "pointrcnn-height")
# A few predictions of box-area lie below 0.05 s, where the board's protocol truncates.
RUNS = [(e, p) for e in ESTIMATORS for p in PROTOCOLS if e != "box-area" or p == "toolkit"]


def assert_scores(report: Report, expected: dict[str, Any]) -> None:
    assert list(report.scores) == ["overall", "crucial", "small", "large", "negative"]
    for name, score in report.scores.items():
        assert score.count == expected[name]["count"]
        assert score.mid == pytest.approx(expected[name]["mid"], rel=1e-12, abs=0)
        assert score.rte == pytest.approx(expected[name]["rte"], rel=1e-12, abs=0)


@pytest.fixture(scope="module")
def truth() -> GroundTruth:
    return make_truth(VECTORS["truth"].values(), anno_ids=[int(key) for key in VECTORS["truth"]])


@pytest.mark.parametrize(("case", "protocol"), CASES)
def test_means_are_the_toolkits(truth: GroundTruth, case: str, protocol: str) -> None:
    vector = VECTORS["cases"][case]
    predictions = read_predictions(flat(vector["predictions"]), manifest=truth.manifest)
    assert_scores(evaluate(predictions, truth, protocol=protocol), vector["expected"])


@pytest.mark.parametrize(("case", "protocol"), CASES)
def test_values_of_single_sequences_are_the_toolkits(truth: GroundTruth, case: str, protocol: str) -> None:
    vector = VECTORS["cases"][case]
    predictions = read_predictions(flat(vector["predictions"]), manifest=truth.manifest)
    sequences = evaluate(predictions, truth, protocol=protocol, keep_sequences=True).sequences
    assert sequences is not None
    assert sequences["mid"][:24].tolist() == pytest.approx(vector["first_mid"], rel=1e-12, abs=0)
    assert sequences["rte"][:24].tolist() == pytest.approx(vector["first_rte"], rel=1e-12, abs=0)


@pytest.fixture(scope="module")
def driving(kitti: Path) -> GroundTruth:
    return read_truth(kitti / "truth.csv")


@pytest.mark.parametrize("form", ["ttc", "scale_ratio"])
@pytest.mark.parametrize(("estimator", "protocol"), RUNS)
def test_estimators_on_real_driving_score_as_with_the_toolkit(
    kitti: Path, driving: GroundTruth, estimator: str, form: str, protocol: str
) -> None:
    expected = json.loads((kitti / "expected.json").read_text(encoding="utf-8"))[estimator]
    data = (kitti / "predictions" / f"{estimator}.{form}.json").read_bytes()
    assert_scores(
        evaluate(read_predictions(data, manifest=driving.manifest), driving, protocol=protocol), expected
    )
