"""A training with Lightning that a test starts: `python lightning_training.py FOLDER DEVICES PRECISION…`."""

import json
import sys
from pathlib import Path
from typing import Any

import torch
from lightning.pytorch import LightningModule, Trainer
from lightning.pytorch.callbacks import ModelCheckpoint
from torch.utils.data import DataLoader, TensorDataset

from evaluator import read_truth
from evaluator.lightning import ScoreCallback

TRUTH = Path(__file__).parents[2] / "examples" / "truth.csv"


class Model(LightningModule):
    """One number that is learned: the factor from the true times to the predicted ones."""

    def __init__(self) -> None:
        super().__init__()
        self.factor = torch.nn.Linear(1, 1, bias=False)
        torch.nn.init.constant_(self.factor.weight, 2.0)

    def training_step(self, batch: Any, _number: int) -> torch.Tensor:
        return (
            (self.factor(batch[1][:, None].to(self.factor.weight.dtype)) / batch[1][:, None] - 1).abs().mean()
        )

    def validation_step(self, batch: Any, _number: int) -> dict[str, Any]:
        rows, ttc_s = batch
        return {"rows": rows, "ttc_s": self.factor(ttc_s[:, None].to(self.factor.weight.dtype))[:, 0]}

    def configure_optimizers(self) -> torch.optim.Optimizer:
        return torch.optim.SGD(self.parameters(), lr=0.01)


def train(out: Path, *, precision: str, n_devices: int) -> None:
    """Train two epochs; the main process writes the scores, and what the checkpoint followed."""
    truth = read_truth(TRUTH)
    data = TensorDataset(torch.arange(60), torch.tensor(truth.ttc_s, dtype=torch.float32))
    scores = ScoreCallback(truth)
    best = ModelCheckpoint(out.parent, monitor="tsttc/mid", filename=out.stem)
    trainer = Trainer(
        accelerator="cpu",
        devices=n_devices,
        strategy="ddp" if n_devices > 1 else "auto",
        precision=precision,  # type: ignore[arg-type]
        max_epochs=2,
        callbacks=[scores, best],
        logger=False,
        enable_progress_bar=False,
        enable_model_summary=False,
    )
    model = Model()
    # 7 does not divide 60, nor does it with two devices: some sequences are predicted twice.
    trainer.fit(model, DataLoader(data, batch_size=7, shuffle=True), DataLoader(data, batch_size=7))
    if trainer.is_global_zero:
        report = scores.metric.report
        document = {
            "factor": float(model.factor.weight),
            "report": report.flat() if report else None,
            "logged": {name: float(value) for name, value in trainer.callback_metrics.items()},
            "best": float(best.best_model_score or "nan"),
        }
        out.write_text(json.dumps(document))


if __name__ == "__main__":
    for name in sys.argv[3:]:
        train(Path(sys.argv[1]) / f"{name}.json", precision=name, n_devices=int(sys.argv[2]))
