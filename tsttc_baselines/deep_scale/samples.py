"""Training samples of the network: crops of pairs with their labels, in batches."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from tsttc_baselines.deep_scale.crops import CropPair
from tsttc_baselines.deep_scale.estimator import cut
from tsttc_baselines.deep_scale.fit_samples import FitSample, fit_sample
from tsttc_baselines.deep_scale.network import Operations
from tsttc_baselines.deep_scale.weights import Use
from tsttc_baselines.estimates import Unusable
from tsttc_baselines.pairs import Pair, Source, augmented, can_say, usable_pair

_SHRINKING: Final = 0.6
"""The longest side of a box is drawn from so much of `Use.max_box_px` up to all of it."""

_N_SORTED: Final = 8
"""Batches of pairs that are sorted by size together: a batch is as large as its largest pair."""


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """The network's input and label of a pair, and perhaps the fit's."""

    crops: CropPair
    scale_ratio: float
    fit: FitSample | None = None


def batches(
    source: Source, *, use: Use, size: int, rng: np.random.Generator, fitting: Operations | None = None
) -> Iterator[tuple[int, list[Sample]]]:
    """Yield an epoch's batches in random order, with their numbers of sequences."""
    # Unusable sequences and those with an α outside of the network's range are left out. With `fitting`,
    # samples also train the fit.
    scale_ratios = source.scale_ratios
    rows = rng.permutation(len(scale_ratios))
    for first in range(0, len(rows), size * _N_SORTED):
        chosen = rows[first : first + size * _N_SORTED]
        samples = [
            _sample(pair, use=use, fitting=fitting, rng=rng)
            for row in chosen.tolist()
            if (pair := _pair(source, row, float(scale_ratios[row]), rng=rng)) is not None
        ]
        samples.sort(key=lambda sample: sample.crops.reference.pixels.size)
        starts = range(0, len(samples), size)
        n_rows = len(chosen) / max(1, len(starts))
        for number, position in enumerate(rng.permutation(len(starts)).tolist()):
            n_before, n_after = round(number * n_rows), round((number + 1) * n_rows)
            yield n_after - n_before, samples[starts[position] : starts[position] + size]


def _pair(source: Source, row: int, scale_ratio: float, *, rng: np.random.Generator) -> Pair | None:
    if not can_say(scale_ratio):
        return None
    try:
        return augmented(usable_pair(source, row, scale_ratio=scale_ratio), rng=rng)
    except Unusable:
        return None


def _sample(pair: Pair, *, use: Use, fitting: Operations | None, rng: np.random.Generator) -> Sample:
    frames, scale_ratio = (pair.reference, pair.target), pair.scale_ratio
    shrunk = float(use.max_box_px * _SHRINKING ** rng.random())
    crops = cut(frames, pair.boxes, use=Use(use.similarity, use.n_cells, shrunk, use.margin_px))
    if fitting is None:
        return Sample(crops, scale_ratio)
    fit = fit_sample(frames, pair.boxes, scale_ratio=scale_ratio, operations=fitting, rng=rng)
    return Sample(crops, scale_ratio, fit)
