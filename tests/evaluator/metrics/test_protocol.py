"""Protocols that contradict themselves or each other are refused, with the two places."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evaluator import Predictions, evaluate
from evaluator.metrics.protocol import PROTOCOLS, TTC_RANGES, Protocol, TTCRange, registered
from evaluator.metrics.registry import MID, RTE
from tests.evaluator.worlds import make_truth

FIRST = PROTOCOLS["tsttc-1"]
HALF_OPEN = (
    TTCRange("near", 0.0, 3.0, is_low_open=True),
    TTCRange("far", 3.0, 20.0, is_low_open=True),
    TTCRange("away", -20.0, 0.0, is_high_open=True),
)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"metrics": ()}, "it has no metric"),
        ({"limit_s": 0.0}, "its limit is 0 s"),
        ({"limit_s": float("inf")}, "its limit is inf s"),
        ({"near_zero_s": (-25.0, 0.05)}, "near 0 it truncates to -25 s and 0.05 s, and its limit is 20 s"),
        ({"near_zero_s": (0.1, 0.2)}, "near 0 it truncates to 0.1 s and 0.2 s"),
        ({"ranges": (TTCRange("near", 3.0, 3.0),)}, "the TTC range 'near' is 3–3 s"),
        ({"ranges": (TTCRange("Near", 0.0, 3.0),)}, "the TTC range 0–3 s is called 'Near'"),
        ({"ranges": (TTCRange("overall", 0.0, 3.0),)}, "the TTC range 0–3 s is called 'overall'"),
        (
            {"ranges": (TTCRange("near", 0.0, 1.0), TTCRange("near", 1.0, 2.0))},
            "the TTC range 0–1 s and the TTC range 1–2 s both are called 'near'",
        ),
        (
            {"ranges": (TTCRange("near", 0.0, 1.0), TTCRange("next", 1.0, 2.0))},
            "the TTC range near (0–1 s) and the TTC range next (1–2 s) both begin with the letter 'n'",
        ),
        ({"ranges": (TTCRange("rte", 0.0, 1.0),)}, "the metric RTE and the TTC range 0–1 s both are called"),
        (
            {"metrics": (MID, replace(RTE, symbol="MiD"))},
            "the metric mid and the metric rte both are called 'MiD'",
        ),
    ],
)
def test_a_protocol_that_contradicts_itself_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=f"Protocol 'tsttc-1': {re.escape(words)}"):
        replace(FIRST, **changes)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"ranges": (TTCRange("small", 6.0, 10.0),)},
            "'small' is the TTC range 3–6 s in protocol 'tsttc-1' and the TTC range 6–10 s in protocol",
        ),
        (
            {"ranges": (replace(TTC_RANGES[1], is_high_open=True),)},
            "'small' is the TTC range 3–6 s in protocol 'tsttc-1' and the TTC range [3, 6) s in protocol",
        ),
        (
            {"metrics": (replace(MID, decimals=1),)},
            "'mid' is the metric Motion-in-depth error (MiD) in protocol 'tsttc-1' and the metric",
        ),
        ({"ranges": (TTCRange("mid", 0.0, 1.0),), "metrics": (RTE,)}, "'mid' is the metric"),
        ({"name": "tsttc-1"}, "Two protocols are called 'tsttc-1'"),
    ],
)
def test_a_name_that_means_something_else_in_another_protocol_is_refused(
    changes: dict[str, Any], words: str
) -> None:
    with pytest.raises(ValueError, match=re.escape(words)):
        registered(FIRST, replace(FIRST, **{"name": "other", **changes}))


def test_a_sequence_at_an_open_end_is_not_in_the_range() -> None:
    truth = make_truth([3.0, 20.0, -20.0, 1.0])
    rules = Protocol("half-open", limit_s=20.0, near_zero_s=None, ranges=HALF_OPEN, metrics=(RTE,))
    predictions = Predictions.from_arrays(ttc_s=truth.ttc_s * 1.5, manifest=truth.manifest)
    report = evaluate(predictions, truth, protocol=rules, keep_sequences=True)
    assert {name: score.count for name, score in report.scores.items()} == {
        "overall": 4,
        "near": 2,
        "far": 1,
        "away": 1,
    }
    assert truth.counts_of(HALF_OPEN) == {"near": 2, "far": 1, "away": 1}
    assert truth.n_outside(HALF_OPEN) == report.n_out_of_range == 0


def test_a_protocol_without_mid_refuses_no_prediction_for_having_none() -> None:
    truth = make_truth([1.0, 2.0])
    predictions = Predictions.from_arrays(ttc_s=np.array([-0.05, 2.0]), manifest=truth.manifest)
    rules = Protocol("no-mid", limit_s=20.0, near_zero_s=None, metrics=(RTE,))
    assert evaluate(predictions, truth, protocol=rules).scores["overall"].rte == pytest.approx(52.5)
