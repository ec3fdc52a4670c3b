"""Scale ratios at any frame gap: scored as they are, or turned into seconds, or to another gap."""

from pathlib import Path

import numpy as np

import evaluator
from evaluator import convert_rate, fps_of_gap, scale_ratio_to_ttc, ttc_to_scale_ratio

HERE = Path(__file__).parent
truth = evaluator.read_truth(HERE / "truth.csv")

for frame_gap in range(1, 6):
    # Size in the earlier frame over size in the last one; below 1 it comes nearer.
    ratios = ttc_to_scale_ratio(truth.ttc_s * 1.05, fps_hz=fps_of_gap(frame_gap))

    # A file may have the ratios themselves: it says of which frames they are.
    data = evaluator.write_predictions(manifest=truth.manifest, scale_ratio=ratios, frame_gap=frame_gap)
    report = evaluator.evaluate(evaluator.read_predictions(data, manifest=truth.manifest), truth)

    ttc_s = scale_ratio_to_ttc(ratios, fps_hz=fps_of_gap(frame_gap))
    at_10_hz = convert_rate(ratios, from_fps_hz=fps_of_gap(frame_gap), to_fps_hz=10)
    assert np.allclose(ttc_s, scale_ratio_to_ttc(at_10_hz, fps_hz=10))
    print(f"frame gap {frame_gap}: MiD {report.scores['overall'].mid:.2f}")
