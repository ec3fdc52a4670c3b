"""The report as JSON, and the one rounding of what is published."""

import json
import math
from decimal import ROUND_HALF_EVEN, Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluator import evaluate, format_rounded, read_predictions, rounded
from evaluator.predictions.loading import sha256_digest
from tests.evaluator.worlds import flat, make_truth


def test_the_json_has_the_agreed_shape_at_full_precision() -> None:
    truth = make_truth([1.0, 4.0, 10.0, 30.0])
    data = flat([1.1, 4.1, 1e9, 0.01])
    report = evaluate(read_predictions(data, manifest=truth.manifest), truth)
    document = json.loads(report.to_json())
    assert document == report.as_dict()
    assert list(document) == [
        *(
            "protocol",
            "truth_digest",
            "predictions_digest",
            "n_sequences",
            "n_out_of_range",
            "truncated",
            "scores",
        )
    ]
    assert document["protocol"] == "tsttc-1"
    assert document["truth_digest"] == truth.digest
    assert document["predictions_digest"] == sha256_digest(data)
    assert (document["n_sequences"], document["n_out_of_range"]) == (4, 1)
    assert document["truncated"] == {"-20": 0, "-0.15": 0, "0.05": 1, "20": 1}
    assert list(document["scores"]) == ["overall", "crucial", "small", "large", "negative"]
    assert list(document["scores"]["overall"]) == ["mid", "rte", "count"]
    assert document["scores"]["overall"]["mid"] == report.scores["overall"].mid
    assert document["scores"]["negative"] == {"mid": None, "rte": None, "count": 0}


@given(value=st.floats(0, 1e6))
def test_published_values_are_rounded_correctly_half_to_even(value: float) -> None:
    exact = Decimal(value).quantize(Decimal("0.01"), rounding=ROUND_HALF_EVEN)
    assert rounded(value) == float(exact)
    assert format_rounded(value) == str(exact)


def test_published_values_need_not_exist_but_must_be_finite() -> None:
    assert rounded(None) is None
    assert format_rounded(None, missing="none") == "none"
    assert rounded(14.296, decimals=1) == 14.3
    assert format_rounded(14.8, decimals=1) == "14.8"
    assert math.copysign(1, rounded(-0.001) or 0.0) == 1
    for value in (math.nan, math.inf):
        with pytest.raises(ValueError, match="Only finite numbers are published"):
            rounded(value)
