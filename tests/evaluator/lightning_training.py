"""A training with Lightning and the callback of the examples; a program, since DDP starts it once a device.

    python lightning_training.py FOLDER PRECISION DEVICES [BATCHES]

FOLDER has truth.csv. Each process writes there what it has in the end, as rank-0.json, rank-1.json.
"""

import json
import sys
from importlib import import_module
from pathlib import Path

import torch
from lightning.pytorch import LightningModule, Trainer
from lightning.pytorch.callbacks import ModelCheckpoint
from torch.utils.data import DataLoader, TensorDataset

import evaluator

sys.path.insert(0, str(Path(__file__).parents[2] / "examples"))


class Longer(LightningModule):
    """Predicts 1.1 times the truth, and learns nothing."""

    def __init__(self) -> None:
        super().__init__()
        self.net = torch.nn.Linear(1, 1, bias=False)
        torch.nn.init.constant_(self.net.weight, 1.1)

    def training_step(self, batch: list[torch.Tensor]) -> torch.Tensor:
        return self.net(batch[1]).mean()

    def validation_step(self, batch: list[torch.Tensor]) -> dict[str, torch.Tensor]:
        return {"row": batch[0], "ttc_s": self.net(batch[1])[:, 0]}

    def configure_optimizers(self) -> torch.optim.Optimizer:
        return torch.optim.SGD(self.parameters(), lr=0.0)


def main(folder: Path, precision: str, n_devices: int, n_batches: int | float = 1.0) -> None:
    truth = evaluator.read_truth(folder / "truth.csv")
    seconds = torch.from_numpy(truth.ttc_s.copy()).float()[:, None]
    data = TensorDataset(torch.arange(truth.n_sequences), seconds)
    scores = import_module("lightning_callback").TsttcScores(folder / "truth.csv")
    checkpoint = ModelCheckpoint(dirpath=folder, monitor="tsttc/mid")
    trainer = Trainer(
        accelerator="cpu",
        devices=n_devices,
        strategy="ddp" if n_devices > 1 else "auto",
        precision=precision,
        max_epochs=2,
        limit_val_batches=n_batches,
        callbacks=[scores, checkpoint] if n_batches == 1.0 else [scores],
        enable_checkpointing=n_batches == 1.0,
        enable_progress_bar=False,
        enable_model_summary=False,
        logger=False,
    )
    trainer.fit(Longer(), DataLoader(data, batch_size=8), DataLoader(data, batch_size=8))
    best = checkpoint.best_model_score
    found = {
        "ttc_s": scores.ttc_s.tolist(),
        "flat": scores.report.flat() if scores.report else None,
        "logged": {name: float(value) for name, value in trainer.callback_metrics.items()},
        "best": None if best is None else float(best),
    }
    (folder / f"rank-{trainer.global_rank}.json").write_text(json.dumps(found))


if __name__ == "__main__":
    folder, precision, n_devices, *n_batches = sys.argv[1:]
    main(Path(folder), precision, int(n_devices), *map(int, n_batches))
