"""The floor of a board: what the ground truth itself scores, and that nothing scores less."""

import numpy as np
import pytest

from evaluator import Predictions, evaluate
from evaluator.metrics.protocol import PROTOCOLS, SCORE_NAMES
from evaluator.scoring.scores import floor_of, floor_sentence
from tests.evaluator.worlds import errors_of_the_toolkit, make_truth

TIMES_S = [-300.0, -45.0, -20.0, -12.0, -0.12, 0.03, 1.0, 4.0, 12.0, 20.0, 25.0, 1e6]


def test_the_floor_is_the_mean_error_of_truncation_by_a_plain_loop() -> None:
    truth = make_truth(TIMES_S)
    kept = [max(-20.0, min(20.0, tau)) for tau in TIMES_S]
    kept[4], kept[5] = -0.15, 0.05
    floor = floor_of(truth)
    errors = [errors_of_the_toolkit(p, t) for p, t in zip(kept, TIMES_S, strict=True)]
    for metric in ("mid", "rte"):
        assert floor[metric] == pytest.approx(np.mean([each[metric] for each in errors]), rel=1e-9)
    inside = {name: value for name, value in floor.items() if name.endswith(("small", "large"))}
    assert set(inside.values()) == {0.0}
    assert list(floor) == list(SCORE_NAMES)


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_no_file_scores_less_than_the_floor(protocol: str) -> None:
    truth = make_truth([tau for tau in TIMES_S if tau not in (-0.12, 0.03)])
    floor = floor_of(truth, protocol=protocol)
    rng = np.random.default_rng(7)
    for _ in range(50):
        values = truth.ttc_s * rng.choice([1.0, 0.9, 1.2], size=truth.n_sequences)
        scored = evaluate(
            Predictions.from_arrays(ttc_s=values, manifest=truth.manifest), truth, protocol=protocol
        )
        for name, value in scored.flat().items():
            assert value is None or value >= (floor[name] or 0.0) - 1e-12, name


def test_an_interval_without_sequences_has_no_floor() -> None:
    floor = floor_of(make_truth([1.0, 2.0, 30.0]))
    assert floor["mid_negative"] is None
    assert "every other column" in floor_sentence(floor)
