"""A training loop that scores each epoch as the board does, keeps the best one and writes its file."""

from pathlib import Path

import numpy as np

import evaluator

HERE = Path(__file__).parent
truth = evaluator.read_truth(HERE / "truth.csv")
rng = np.random.default_rng(1)

# In place of a network: a line from a noisy observation to the logarithm of the scale ratio over five frames.
target = np.log(evaluator.ttc_to_scale_ratio(truth.ttc_s, fps_hz=2))
features = np.stack([0.7 * target + rng.normal(0, 0.005, len(target)), np.ones(len(target))])
weights = np.zeros(2)

best_mid, best_ratios = np.inf, np.ones(len(target))
for epoch in range(1, 201):
    error = weights @ features - target
    weights -= 0.5 * features @ error / len(target)
    if epoch % 50:
        continue
    # What a network predicts, in the order of the manifest; scoring takes less than a millisecond.
    ratios = np.exp(weights @ features)
    predictions = evaluator.Predictions.from_arrays(scale_ratio=ratios, frame_gap=5, manifest=truth.manifest)
    report = evaluator.evaluate(predictions, truth)
    # `report.flat()` is what a logger takes: writer.add_scalar, wandb.log, trainer.log_dict.
    mid = report.scores["overall"].mid
    print(f"epoch {epoch}: MiD {mid:.2f}, crucial {report.scores['crucial'].mid:.2f}")
    if mid is not None and mid < best_mid:
        best_mid, best_ratios = mid, ratios

# Where the best epoch is wrong; `report.by("recording")` is this as a pandas frame, `report.plot()` a figure.
best = evaluator.Predictions.from_arrays(scale_ratio=best_ratios, frame_gap=5, manifest=truth.manifest)
report = evaluator.evaluate(best, truth, keep_sequences=True)
worst = max(report.breakdown("recording"), key=lambda group: group.scores["mid"] or 0)
print(f"worst recording {worst.group}: MiD {worst.scores['mid']:.2f} of {worst.n_sequences} sequences")

data = evaluator.write_predictions(manifest=truth.manifest, scale_ratio=best_ratios, frame_gap=5)
print(f"best MiD {best_mid:.2f}; {len(data):,} bytes for tsttc submit")
