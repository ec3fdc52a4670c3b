"""A callback for Lightning: MiD and RTE of each validation epoch, as the board computes them.

    trainer = Trainer(callbacks=[TsttcScores("annotations/val/")])

The model's `validation_step` returns {"row": …, "ttc_s": …}: rows of the manifest and seconds, one for each
item of the batch. `ModelCheckpoint(monitor="tsttc/mid")` and `EarlyStopping` then follow the board's number.
`scores.report` is the report of the last epoch: `report.by("recording")`, `report.frame()`, `report.plot()`.
"""

from typing import Any

import numpy as np

import evaluator

try:
    from lightning.pytorch import Callback
except ModuleNotFoundError:  # the hooks are called by name, so that this file is tested without Lightning
    Callback = object


def on_cpu(values: Any) -> Any:
    """A tensor or an array as an array."""
    return np.asarray(values.detach().cpu() if hasattr(values, "detach") else values)


class TsttcScores(Callback):
    """Collects the predictions of an epoch and logs their scores as `tsttc/mid`, `tsttc/mid_crucial`, …"""

    def __init__(self, truth: Any, *, protocol: str = "tsttc-1") -> None:
        self.truth = evaluator.read_truth(truth)
        self.protocol = protocol
        self.ttc_s = np.full(self.truth.n_sequences, np.nan)
        self.report: evaluator.Report | None = None

    def on_validation_epoch_start(self, trainer: Any, pl_module: Any) -> None:
        self.ttc_s = np.full(self.truth.n_sequences, np.nan)

    def on_validation_batch_end(  # noqa: PLR0917 -- the signature is Lightning's
        self, trainer: Any, pl_module: Any, outputs: Any, batch: Any, batch_idx: int, dataloader_idx: int = 0
    ) -> None:
        self.ttc_s[on_cpu(outputs["row"])] = on_cpu(outputs["ttc_s"])

    def on_validation_epoch_end(self, trainer: Any, pl_module: Any) -> None:
        if trainer.sanity_checking or np.isnan(self.ttc_s).any():
            return  # only a part of the sequences was predicted
        predictions = evaluator.Predictions.from_arrays(ttc_s=self.ttc_s, manifest=self.truth.manifest)
        self.report = evaluator.evaluate(predictions, self.truth, protocol=self.protocol, keep_sequences=True)
        scores = self.report.flat()
        found = {f"tsttc/{name}": value for name, value in scores.items() if value is not None}
        pl_module.log_dict(found, rank_zero_only=True)
