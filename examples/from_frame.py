"""From a pandas frame straight to a report: rows in any order, named by their natural keys."""

from pathlib import Path

import pandas as pd

import evaluator
from evaluator.frames import predictions_from_frame

HERE = Path(__file__).parent
truth = evaluator.read_truth(HERE / "truth.csv")

# What your model wrote: one row for each sequence, named by recording, camera, time and track.
mine = pd.read_csv(HERE / "truth.csv", dtype={"cam_id": str, "track_id": str}).drop(columns="anno_id")
mine = mine.sample(frac=1.0, random_state=1).assign(ttc_s=mine["ttc"] * 1.05)

predictions = predictions_from_frame(mine, manifest=truth.manifest)
report = evaluator.evaluate(predictions, truth)
print(pd.Series(report.flat()).round(2).to_string())
