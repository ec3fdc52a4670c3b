"""A callback of Lightning: MiD and RTE of each validation epoch, as the board computes them.

    trainer = Trainer(callbacks=[ScoreCallback("annotations/val/"), ModelCheckpoint(monitor="tsttc/mid")])

Needs lightning and torchmetrics.
"""

from __future__ import annotations

from typing import Any

from evaluator.torch import ScoreMetric

try:
    from lightning.pytorch import Callback
except ModuleNotFoundError as missing:
    message = f"evaluator.lightning needs {missing.name}; install it with: pip install lightning"
    raise ModuleNotFoundError(message, name=missing.name) from None


class ScoreCallback(Callback):  # type: ignore[misc]  # of an extra, which mypy skips
    """Logs `tsttc/mid`, `tsttc/mid_crucial`, … after each validation, with any precision and device count.

    The arguments are those of `ScoreMetric`; the attribute `metric` is that object. The model's
    `validation_step` returns a dict with the arguments of `ScoreMetric.update`: `{"rows": …, "ttc_s": …}` or
    `{"rows": …, "scale_ratio": …, "frame_gap": 5}`. Of several validation loaders only the first is scored.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        self.metric = ScoreMetric(*arguments, **options)

    def on_validation_epoch_start(self, trainer: Any, pl_module: Any) -> None:
        """Begin the epoch."""
        self.metric.to(pl_module.device)
        self.metric.reset()

    def on_validation_batch_end(  # noqa: PLR0917 -- the signature is Lightning's
        self, trainer: Any, pl_module: Any, outputs: Any, batch: Any, batch_idx: int, dataloader_idx: int = 0
    ) -> None:
        """Take the predictions of a batch."""
        if dataloader_idx == 0:
            self.metric.update(**outputs)

    def on_validation_epoch_end(self, trainer: Any, pl_module: Any) -> None:
        """Log the scores of all devices."""
        if not trainer.sanity_checking:  # that predicts a few batches only
            scores = self.metric.compute()
            pl_module.log_dict({f"tsttc/{name}": value for name, value in scores.items()}, sync_dist=False)
