"""Alignment finds the scale ratios of rendered frames: so the frames have them, and so does the method."""

from functools import cache

import numpy as np
import pytest

from evaluator.metrics.registry import MID
from evaluator.metrics.scale import scale_ratio_to_ttc
from tsttc_baselines.alignment import Alignment, Template
from tsttc_baselines.boxes import centre_of, size_of
from tsttc_baselines.clips import TARGET
from tsttc_baselines.rendering.clips import Rendered, render
from tsttc_baselines.simulation import Split, split

pytestmark = pytest.mark.slow

N_SEQUENCES = 80


@cache
def simulated() -> Split:
    return split(rng=np.random.default_rng(5), n_sequences=N_SEQUENCES, n_recordings=8)


@cache
def rendered() -> list[Rendered]:
    return [render(simulated(), anno_id=anno_id, seed=11) for anno_id in range(N_SEQUENCES)]


def errors(scale_ratios: list[float], anno_ids: list[int]) -> np.ndarray:
    ttc_s = np.clip(scale_ratio_to_ttc(scale_ratios, fps_hz=2), -20, 20)
    return MID.errors(ttc_s, np.array(simulated().table.ttc_s)[anno_ids])


def test_alignment_that_starts_at_the_truth_stays_there() -> None:
    ratios, anno_ids = [], []
    for sequence in rendered():
        target_box, reference_box = sequence.true_boxes[TARGET], sequence.true_boxes[0]
        if size_of(target_box)[0] <= 60:
            continue
        gap_m = simulated().gap_m[sequence.anno_id]
        template = Template.of(sequence.clip.grey(TARGET), target_box, n_samples=64)
        fit = template.aligned(
            sequence.clip.grey(0),
            centre=centre_of(reference_box),
            scale_ratio=float(gap_m[TARGET] / gap_m[0]),
            robust=True,
        )
        ratios.append(fit.scale_ratio)
        anno_ids.append(sequence.anno_id)
    assert len(ratios) > 20
    assert np.median(errors(ratios, anno_ids)) <= 1.5


def test_the_median_error_with_detected_boxes_is_at_most_3_5_mid() -> None:
    align = Alignment()
    ratios = [align(sequence.clip, frame_gap=TARGET).scale_ratio for sequence in rendered()]
    assert np.median(errors(ratios, list(range(N_SEQUENCES)))) <= 3.5
