"""The confidence interval of a score, and whether one model is significantly better than another."""

import numpy as np

import evaluator
from evaluator import Table

# Ground truth of one's own: forty recordings of fifty sequences, as few recordings say little.
rng = np.random.default_rng(7)
n = 40 * 50
truth = evaluator.GroundTruth.from_table(
    Table(
        anno_id=list(range(n)),
        bag_stamp=[f"recording-{i // 50:02}" for i in range(n)],
        cam_id=["1"] * n,
        ts_ns=list(range(n)),
        track_id=["1"] * n,
        ttc_s=rng.uniform(0.5, 20, n).tolist(),
    )
)
old, new = (
    evaluator.Predictions.from_arrays(ttc_s=truth.ttc_s * rng.normal(1.0, spread, n), manifest=truth.manifest)
    for spread in (0.12, 0.10)
)

interval = evaluator.confidence_intervals(new, truth)["mid"]
shown = "[{:.1f}, {:.1f}]".format(*interval) if interval else "too few recordings for an interval"
print(f"MiD of the new one: {evaluator.evaluate(new, truth).scores['overall'].mid:.1f} {shown}")

found = evaluator.compare_predictions(new, old, truth)["mid"]
print(f"new − old: {found.difference:+.1f} [{found.low:+.1f}, {found.high:+.1f}], p = {found.p:.4f}")
