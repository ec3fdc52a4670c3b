"""Parts of a ground truth and of predictions: folds, batches, values by key."""

from __future__ import annotations

from importlib.metadata import version
from typing import get_args

import numpy as np
import pytest

import evaluator
from evaluator import GroundTruth, Predictions, Rejected, evaluate, read_truth
from evaluator.metrics.protocol import PROTOCOLS, ProtocolName
from evaluator.scoring.breakdown import GROUPS, GroupName
from evaluator.units import KINDS, UnitKind
from tests.evaluator.worlds import EXAMPLES


@pytest.fixture(scope="module")
def truth() -> GroundTruth:
    return read_truth(EXAMPLES / "truth.csv")


@pytest.fixture(scope="module")
def predictions(truth: GroundTruth) -> Predictions:
    return evaluator.read_predictions(EXAMPLES / "predictions.json", manifest=truth.manifest)


def test_subset_scores_as_the_mean_of_its_sequences(truth: GroundTruth, predictions: Predictions) -> None:
    mask = np.array(truth.manifest.bag_stamp) == truth.manifest.recordings[0]
    errors = np.array(evaluate(predictions, truth, keep_sequences=True).records()["mid"], dtype=np.float64)
    for chosen in (mask, np.flatnonzero(mask), mask.tolist()):
        report = evaluate(predictions.subset(chosen), truth.subset(chosen))
        assert report.n_sequences == mask.sum()
        assert report.scores["overall"].mid == pytest.approx(errors[mask].mean(), rel=1e-12)
    assert truth.subset(mask).manifest.anno_id.tolist() == truth.manifest.anno_id[mask].tolist()
    assert truth.subset(np.ones(60, dtype=bool)).digest == truth.digest


@pytest.mark.parametrize("chosen", [[True] * 59, [60], [1, 1], [0.5], [False] * 60])
def test_rows_that_are_not_there_are_refused(truth: GroundTruth, chosen: list[object]) -> None:
    with pytest.raises((IndexError, Rejected)):
        truth.subset(chosen)


def test_values_by_key_are_those_of_a_file(truth: GroundTruth, predictions: Predictions) -> None:
    values = predictions.ttc_s.tolist()
    for keys in (truth.manifest.anno_id.tolist(), truth.manifest.natural_keys):
        seconds = dict(reversed(list(zip(keys, values, strict=True))))
        assert Predictions.from_dict(seconds, manifest=truth.manifest).ttc_s.tolist() == values
    with pytest.raises(Rejected, match="59 sequences have no value"):
        Predictions.from_dict({0: np.float32(4.0)}, manifest=truth.manifest)


def test_parts_of_several_processes_are_merged_and_may_overlap(
    truth: GroundTruth, predictions: Predictions
) -> None:
    parts = [predictions.subset(range(start, min(60, start + 25))) for start in (40, 0, 20)]
    merged = Predictions.merge(parts, manifest=truth.manifest)
    assert merged.ttc_s.tolist() == predictions.ttc_s.tolist()
    with pytest.raises(Rejected, match="15 sequences have no value"):
        Predictions.merge(parts[:2], manifest=truth.manifest)


def test_names_for_an_editor_are_those_that_there_are() -> None:
    assert set(get_args(ProtocolName)) == set(PROTOCOLS)
    assert set(get_args(GroupName)) == {*GROUPS, *(name.replace("-", "_") for name in GROUPS)}
    assert set(get_args(UnitKind)) == set(KINDS)
    assert evaluator.__version__ == version("tsttc")
