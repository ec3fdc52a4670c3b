"""A callback for Lightning: MiD and RTE of each validation epoch, as the board computes them.

    trainer = Trainer(callbacks=[TsttcScores("annotations/val/")])

The model's `validation_step` returns {"row": …, "ttc_s": …}: rows of the manifest and seconds, one for each
item of the batch, in any precision. `ModelCheckpoint(monitor="tsttc/mid")` and `EarlyStopping` then follow
the board's number, with several devices too: each gathers the predictions of all. An epoch without all
sequences has no scores, and a warning says so.
`scores.report` is the report of the last epoch: `report.by("recording")`, `report.frame()`, `report.plot()`.
"""

import warnings
from typing import Any

import numpy as np

import evaluator

try:
    from lightning.pytorch import Callback
except ModuleNotFoundError:  # the hooks are called by name, so that this file is tested without Lightning
    Callback = object


def as_array(values: Any) -> Any:
    """A tensor or an array as an array of float64, which numpy has and bfloat16 fits in."""
    return np.asarray(
        values.detach().cpu().double() if hasattr(values, "detach") else values, dtype=np.float64
    )


class TsttcScores(Callback):
    """Collects the predictions of an epoch and logs their scores as `tsttc/mid`, `tsttc/mid_crucial`, …"""

    def __init__(self, truth: Any, *, protocol: str = "tsttc-1") -> None:
        self.truth = evaluator.read_truth(truth)
        self.protocol = protocol
        self.ttc_s = np.full(self.truth.n_sequences, np.nan)
        self.report: evaluator.Report | None = None

    def on_validation_epoch_start(self, trainer: Any, pl_module: Any) -> None:
        self.ttc_s = np.full(self.truth.n_sequences, np.nan)
        self.report = None

    def on_validation_batch_end(  # noqa: PLR0917 -- the signature is Lightning's
        self, trainer: Any, pl_module: Any, outputs: Any, batch: Any, batch_idx: int, dataloader_idx: int = 0
    ) -> None:
        self.ttc_s[as_array(outputs["row"]).astype(np.intp)] = as_array(outputs["ttc_s"])

    def on_validation_epoch_end(self, trainer: Any, pl_module: Any) -> None:
        if trainer.sanity_checking:
            return  # only a few batches were predicted
        if trainer.world_size > 1:
            for ttc_s in as_array(pl_module.all_gather(self.ttc_s)):  # (devices, n)
                self.ttc_s = np.where(np.isnan(self.ttc_s), ttc_s, self.ttc_s)
        n_missing = int(np.isnan(self.ttc_s).sum())
        if n_missing:
            message = (
                f"The epoch has no tsttc/ scores: {n_missing} of {len(self.ttc_s)} sequences have no "
                "prediction, or NaN; expected each row of the manifest once."
            )
            warnings.warn(message, stacklevel=2)
            return
        predictions = evaluator.Predictions.from_arrays(ttc_s=self.ttc_s, manifest=self.truth.manifest)
        self.report = evaluator.evaluate(predictions, self.truth, protocol=self.protocol, keep_sequences=True)
        scores = self.report.flat()
        found = {f"tsttc/{name}": value for name, value in scores.items() if value is not None}
        # Every device logs, since ModelCheckpoint looks on each; their values are the same.
        pl_module.log_dict(found, sync_dist=True)
