"""`evaluator.torch`: an epoch's scores are the evaluator's, whatever the tensors and batches are like."""

import copy
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader, random_split

from evaluator import PROTOCOLS, GroundTruth, Predictions, Rejected, evaluate, fps_of_gap, ttc_to_scale_ratio
from evaluator.torch import ScoreMetric
from tests.evaluator.worlds import EXAMPLES, REPOSITORY

pytestmark = pytest.mark.torch


@pytest.fixture
def truth() -> GroundTruth:
    return ScoreMetric(EXAMPLES / "truth.csv")._truth


def scores_of(truth: GroundTruth, ttc_s: np.ndarray, protocol: str = "tsttc-1") -> dict[str, float | None]:
    predictions = Predictions.from_arrays(ttc_s=ttc_s, manifest=truth.manifest)
    return evaluate(predictions, truth, protocol=protocol).flat()


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_scores_of_an_epoch_are_those_of_the_evaluator(truth: GroundTruth, protocol: str) -> None:
    metric = ScoreMetric(truth, protocol=protocol)
    ttc_s = 1.1 * truth.ttc_s
    for rows in torch.randperm(60).split(7):
        metric.update(rows, torch.from_numpy(ttc_s)[rows])
    expected = scores_of(truth, ttc_s, protocol)
    assert {name: value.item() for name, value in metric.compute().items()} == pytest.approx(
        expected, rel=1e-6
    )
    assert metric.report is not None
    assert metric.report.flat() == expected, "to the last bit"
    assert len(metric.report.breakdown("recording")) == 6


@pytest.mark.parametrize("dtype", [torch.bfloat16, torch.float16, torch.float32])
def test_tensors_may_have_any_precision_and_a_gradient_in_a_module_of_bfloat16(
    truth: GroundTruth, dtype: torch.dtype
) -> None:
    module = torch.nn.Module()
    module.metric = ScoreMetric(truth)
    module.to(torch.bfloat16)
    given = torch.tensor(truth.ttc_s, dtype=dtype, requires_grad=True)
    module.metric.update(torch.arange(60), given)
    assert module.metric.compute()["mid"].item() == pytest.approx(
        scores_of(truth, given.detach().double().numpy())["mid"], rel=1e-6
    )


@pytest.mark.parametrize("frame_gap", [1, 5])
def test_scale_ratios_count_as_the_seconds_that_they_mean(truth: GroundTruth, frame_gap: int) -> None:
    metric = ScoreMetric(truth)
    ratios = ttc_to_scale_ratio(1.1 * truth.ttc_s, fps_hz=fps_of_gap(frame_gap))
    metric.update(range(60), scale_ratio=ratios, frame_gap=frame_gap)
    assert metric.compute()["rte"].item() == pytest.approx(
        scores_of(truth, 1.1 * truth.ttc_s)["rte"], rel=1e-6
    )


def test_a_fold_is_scored_alone_by_the_rows_of_the_whole(truth: GroundTruth) -> None:
    _, fold = random_split(list(range(60)), [40, 20], generator=torch.Generator().manual_seed(3))  # type: ignore[arg-type]
    metric = ScoreMetric(truth, rows=fold.indices)
    for rows in DataLoader(fold, batch_size=8):
        metric.update(rows, 1.1 * truth.ttc_s[rows.numpy()])
    part = truth.subset(fold.indices)
    assert metric.compute()["mid"].item() == pytest.approx(scores_of(part, 1.1 * part.ttc_s)["mid"], rel=1e-6)
    outside = next(row for row in range(60) if row not in fold.indices)
    with pytest.raises(ValueError, match=f"{outside} is not one of the 20 rows of this metric"):
        metric.update([outside], [1.0])
    assert set(ScoreMetric(truth, rows=np.flatnonzero(truth.ttc_s > 0)[:9]).names) < set(metric.names), (
        "a range without sequences has no name"
    )


def test_what_is_missing_or_no_value_is_no_score_and_a_warning(truth: GroundTruth) -> None:
    metric = ScoreMetric(truth)
    ratios = ttc_to_scale_ratio(truth.ttc_s, fps_hz=2)
    ratios[:3] = np.nan, -0.5, 0
    metric.update(range(60), scale_ratio=ratios, frame_gap=5)
    with pytest.warns(
        UserWarning, match=re.escape("There is no score: 3 of 60 sequences have no prediction")
    ):
        assert torch.stack(list(metric.compute().values())).isnan().all()
    metric.update([0, 1, 2], truth.ttc_s[:3])
    assert metric.compute()["mid"].item() < 1


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        (([0], [1.0]), {"frame_gap": 5}, "Times to contact have no rate"),
        (([0],), {"scale_ratio": [0.9]}, "Scale ratios need either fps_hz or frame_gap"),
        (([0],), {}, "Give either ttc_s, or scale_ratio"),
        (([0, 1], [1.0]), {}, "expected one for each"),
        (([60], [1.0]), {}, "60 is not one of the 60 rows"),
        (([-1], [1.0]), {}, "-1 is not one of the 60 rows"),
    ],
)
def test_wrong_arguments_are_named(truth: GroundTruth, arguments: tuple, options: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ScoreMetric(truth).update(*arguments, **options)
    with pytest.raises(Rejected):
        ScoreMetric(EXAMPLES / "manifest.csv")


@pytest.mark.parametrize(
    "rows",
    [
        lambda: torch.tensor([4.0, 13.94]),
        lambda: torch.tensor([4.0, 13.0], dtype=torch.bfloat16),
        lambda: torch.tensor([True, False]),
        lambda: np.array([4.0, 13.94]),
        lambda: [torch.tensor(4.0), torch.tensor(13.94)],
    ],
)
def test_predictions_instead_of_rows_are_refused(truth: GroundTruth, rows: Callable[[], Any]) -> None:
    with pytest.raises(TypeError, match="expected whole numbers"):
        ScoreMetric(truth).update(rows(), [4.0, 14.0])
    with pytest.raises(TypeError, match="expected whole numbers"):
        ScoreMetric(truth, rows=rows())


def test_rows_that_are_not_there_or_have_two_values_are_refused(truth: GroundTruth) -> None:
    metric = ScoreMetric(truth)
    for rows in ([-1, 2], [0, 60], torch.tensor([3, -60])):
        with pytest.raises(ValueError, match="is not one of the 60 rows"):
            metric.update(rows, [1.0, 2.0])
        with pytest.raises(ValueError, match="is not one of the 60 rows"):
            ScoreMetric(truth, rows=rows)
    with pytest.raises(ValueError, match="1 rows come twice in the batch, with two values"):
        metric.update([3, 4, 3], [1.0, 2.0, 1.5])
    metric.update([torch.tensor(3), torch.tensor(4), torch.tensor(3)], [1.0, 2.0, 1.0])
    metric.update([], [])


def test_a_metric_can_be_copied_and_saved_with_its_module(truth: GroundTruth, tmp_path: Path) -> None:
    metric = ScoreMetric(truth)
    metric.update(range(60), truth.ttc_s)
    torch.save(metric, tmp_path / "metric.pt")
    loaded = torch.load(tmp_path / "metric.pt", weights_only=False)
    for other in (copy.deepcopy(metric), metric.clone(), loaded):
        assert other.compute()["mid"] == metric.compute()["mid"]


@pytest.mark.parametrize("module", ["torch", "torchmetrics"])
def test_without_torch_a_sentence_says_what_to_install(tmp_path: Path, module: str) -> None:
    (tmp_path / f"{module}.py").write_text(f"raise ModuleNotFoundError('no', name={module!r})")
    program = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import evaluator.torch"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, cwd=REPOSITORY
    )
    assert done.stderr.splitlines()[-1] == (
        f"ModuleNotFoundError: evaluator.torch needs {module}; install it with: "
        "pip install torch torchmetrics"
    )
