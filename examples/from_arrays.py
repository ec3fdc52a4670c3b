"""From numpy arrays straight to a report, and to a file that can be sent."""

from pathlib import Path

import numpy as np

import evaluator

HERE = Path(__file__).parent
truth = evaluator.read_truth(HERE / "truth.csv")

# Your model's seconds, one for each sequence of the manifest and in its order.
ttc_s = truth.ttc_s * np.random.default_rng(1).normal(1.0, 0.1, truth.n_sequences)

predictions = evaluator.Predictions.from_arrays(ttc_s=ttc_s, manifest=truth.manifest)
report = evaluator.evaluate(predictions, truth)
print(f"MiD {report.scores['overall'].mid:.2f}, crucial {report.scores['crucial'].mid:.2f}")
print(f"RTE {report.scores['overall'].rte:.2f}% of {report.n_sequences} sequences")

data = evaluator.write_predictions(manifest=truth.manifest, ttc_s=ttc_s, meta={"model": "mine"})
print(f"{len(data):,} bytes for tsttc submit; write_predictions('mine.json', …) writes them")
