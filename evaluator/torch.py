"""MiD and RTE as a metric of torchmetrics, for one's own training loop.

    scores = ScoreMetric("annotations/val/")
    scores.update(batch["row"], scale_ratio=network(batch), frame_gap=5)  # for each batch
    scores.compute()["mid"]  # of the epoch; scores.report has the rest
    scores.reset()

Needs torch and torchmetrics. Nothing else of the evaluator imports this module, but `evaluator.lightning`.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from evaluator.arguments import Source
from evaluator.arrays import as_floats, whole_numbers
from evaluator.counting import counted
from evaluator.metrics.protocol import DEFAULT_PROTOCOL, OVERALL, Protocol, get_protocol, split_name
from evaluator.metrics.scale import scale_ratio_to_ttc
from evaluator.predictions.loading import Predictions
from evaluator.predictions.values import allowed
from evaluator.predictions.writing import rate_of
from evaluator.scoring.report import Report
from evaluator.scoring.scores import evaluate
from evaluator.truth.ground_truth import GroundTruth, read_truth

try:
    import torch
    from torchmetrics import Metric
except ModuleNotFoundError as missing:
    message = f"evaluator.torch needs {missing.name}; install it with: pip install torch torchmetrics"
    raise ModuleNotFoundError(message, name=missing.name) from None

_NO_VALUE: Final = int(np.array(np.nan).view(np.int64))


class ScoreMetric(Metric):  # type: ignore[misc]  # of an extra, which mypy skips
    """The scores of a board over the sequences of an epoch, by their names: `mid`, `mid_crucial`, …

    `truth` is a ground truth, or what `read_truth` takes. `rows` are the sequences that are predicted, such
    as those of a fold: rows of `truth`, all where None. Each counts once, in whichever batch and on whichever
    device it was predicted. As long as one of them has no value, every score is NaN, and a warning says so.
    `report` is that of the last whole epoch, in float64.
    """

    full_state_update = False
    higher_is_better = False
    is_differentiable = False

    def __init__(
        self,
        truth: GroundTruth | Source,
        *,
        rows: Sequence[int] | None = None,
        protocol: str | Protocol = DEFAULT_PROTOCOL,
        **options: Any,
    ) -> None:
        """Raises `Rejected` as `read_truth`; `ValueError` for rows that the ground truth does not have,
        `TypeError` for rows that are no whole numbers, such as a mask.
        """
        super().__init__(**options)
        whole = truth if isinstance(truth, GroundTruth) else read_truth(truth)
        self._rows = np.arange(whole.n_sequences)
        if rows is not None:
            self._rows = np.unique(whole_numbers(rows, name="rows"))
            outside = self._rows[(self._rows < 0) | (self._rows >= whole.n_sequences)]
            if len(outside):
                raise ValueError(
                    f"{outside[0]} is not one of the {whole.n_sequences:,} rows of the ground truth."
                )
        self._truth = whole if rows is None else whole.subset(self._rows)
        self._index_of = np.full(whole.n_sequences, -1)
        self._index_of[self._rows] = np.arange(len(self._rows))
        self._protocol = get_protocol(protocol) if isinstance(protocol, str) else protocol
        counts = self._truth.counts_of(self._protocol.ranges) | {OVERALL: len(self._rows)}
        self.names = tuple(name for name in self._protocol.score_names if counts[split_name(name)[1]])
        self.report: Report | None = None
        # The bits of float64 as whole numbers: they stay exact in a module of bfloat16, and on devices that
        # have no float64. NaN is greater than every other value, so that the least is what a device knows.
        none = torch.full((len(self._rows),), _NO_VALUE, dtype=torch.int64)
        self.bits: Any
        self.add_state("bits", default=none, dist_reduce_fx="min")

    def update(
        self, rows: Any, ttc_s: Any = None, *, scale_ratio: Any = None, frame_gap: int | None = None
    ) -> None:
        """Take the predictions of a batch: rows of the ground truth, and their seconds or scale ratios.

        Values may be tensors of any precision, device and with a gradient. What no file may hold is no value.
        Raises `TypeError` for rows that are no whole numbers, as in `update(preds, target)`; `ValueError` for
        other shapes, rows that are not expected or have two values, and arguments that do not fit together.
        """
        if (ttc_s is None) == (scale_ratio is None):
            raise ValueError("Give either ttc_s, or scale_ratio and frame_gap.")
        rate_hz = rate_of(is_ratio=ttc_s is None, fps_hz=None, frame_gap=frame_gap)
        values = as_floats(scale_ratio if ttc_s is None else ttc_s)
        indices = self._indices(whole_numbers(rows, name="rows"))
        if values.shape != indices.shape:
            raise ValueError(
                f"The values are {values.shape}, the rows {indices.shape}; expected one for each."
            )
        if rate_hz:
            positive = np.where(allowed(values, unit="scale_ratio"), values, np.nan)
            values = scale_ratio_to_ttc(positive, fps_hz=rate_hz)
        bits = np.where(allowed(values, unit="ttc"), np.ascontiguousarray(values).view(np.int64), _NO_VALUE)
        _require_one_value(indices.ravel(), bits.ravel())
        device = self.bits.device
        self.bits[torch.from_numpy(indices).to(device)] = torch.from_numpy(bits).to(device)

    def _indices(self, rows: Any) -> Any:
        """Where the values of these rows stand among those that are expected."""
        is_there = (rows >= 0) & (rows < len(self._index_of))
        indices = np.where(is_there, self._index_of[np.where(is_there, rows, 0)], -1)
        if (indices < 0).any():
            message = (
                f"{rows[indices < 0].flat[0]} is not one of the {len(self._rows):,} rows of this metric."
            )
            raise ValueError(message)
        return indices

    def compute(self) -> dict[str, Any]:
        """The scores as tensors, of those TTC ranges that have sequences."""
        ttc_s = self.bits.cpu().numpy().view(np.float64)
        n_missing = int(np.isnan(ttc_s).sum())
        if n_missing:
            sequences = counted(len(ttc_s), "sequence")
            message = (
                f"There is no score: {n_missing:,} of {sequences} have no prediction, or none that counts."
            )
            warnings.warn(message, stacklevel=2)
            return dict.fromkeys(
                self.names, torch.tensor(np.nan, dtype=torch.float32, device=self.bits.device)
            )
        predictions = Predictions.from_arrays(ttc_s=ttc_s, manifest=self._truth.manifest)
        self.report = evaluate(predictions, self._truth, protocol=self._protocol, keep_sequences=True)
        scores = self.report.flat()
        device = self.bits.device
        return {name: torch.tensor(scores[name], dtype=torch.float32, device=device) for name in self.names}


def _require_one_value(indices: Any, bits: Any) -> None:
    """Raise `ValueError` where a batch has a row twice, with two values."""
    pairs = np.unique(np.stack([indices, bits]), axis=1)
    doubled = pairs[0][1:][pairs[0][1:] == pairs[0][:-1]]
    if len(doubled):
        raise ValueError(
            f"{len(doubled):,} rows come twice in the batch, with two values; expected each once."
        )
