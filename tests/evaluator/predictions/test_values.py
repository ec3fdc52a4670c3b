"""A rule of values is added once: reading, writing, conversion and scoring ask there."""

from collections.abc import Callable

import numpy as np
import pytest

from evaluator import Predictions, Rejected, convert, evaluate, read_predictions, write_predictions
from evaluator.predictions.values import RULES, Rule
from tests.evaluator.worlds import envelope, flat, make_truth

TRUTH = make_truth([4.0, -10.0, 1.0])
MANIFEST = TRUTH.manifest
NEAR = 2.0**-31
RATIOS = {"0": 0.9, "1": 1.1, "2": 0.8}
A_NANOSECOND = Rule("zero", lambda value: abs(value) >= 1e-9, "a time to contact of a nanosecond or more")

WAYS: dict[str, Callable[[], object]] = {
    "reading": lambda: read_predictions(flat({"0": 4, "1": NEAR, "2": 1}), manifest=MANIFEST),
    "reading what no column holds": lambda: read_predictions(
        flat({"0": 4, "1": NEAR, "2": None}), manifest=MANIFEST
    ),
    "reading ratios": lambda: read_predictions(
        envelope({**RATIOS, "1": NEAR}, unit="scale_ratio", fps=2), manifest=MANIFEST
    ),
    "writing": lambda: write_predictions(keys=["0", "1", "2"], ttc_s=[4.0, NEAR, 1.0]),
    "conversion": lambda: convert(flat({"0": 4, "1": NEAR, "2": 1}), to="scale_ratio"),
    "conversion of ratios": lambda: convert(envelope({**RATIOS, "1": NEAR}, unit="scale_ratio", fps=2)),
    "scoring": lambda: evaluate(
        Predictions.from_arrays(ttc_s=np.array([4.0, NEAR, 1.0]), manifest=MANIFEST), TRUTH
    ),
}


@pytest.mark.parametrize("way", WAYS)
def test_a_rule_that_is_added_holds_everywhere(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(RULES, "ttc", (*RULES["ttc"], A_NANOSECOND))
    with pytest.raises(Rejected) as rejected:
        WAYS[way]()
    problem = rejected.value.problems[0]
    assert (problem.code, problem.where.removeprefix("/predictions")) == ("zero", "/1")
    assert problem.message.endswith("; expected a time to contact of a nanosecond or more.")
