"""Ablations of Pixel MSE: one setting varied, scores next to the paper's.

    rows = scores_of_settings(get_ablation("frame-gap"), folder=folder, truth=truth)

The paper's numbers are of TSTTC's validation split; on other drives only the trend over settings compares.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from evaluator import GroundTruth, Predictions, evaluate, fps_of_gap, scale_ratio_to_ttc
from evaluator.counting import counted
from evaluator.papers.tables import published_tables
from evaluator.problems import reject
from tsttc_baselines.clips import TARGET
from tsttc_baselines.folder_checks import require_usable
from tsttc_baselines.folders import SequenceFolder
from tsttc_baselines.methods import Value, get_method
from tsttc_baselines.outcomes import Outcome, SequenceEstimator
from tsttc_baselines.processes import worked_through

METHOD: Final = "pixel-mse"
METRICS: Final = ("mid", "rte")
FRAME_GAP: Final = 5


@dataclass(frozen=True, slots=True)
class Ablation:
    """A varied setting: `parameter` of Pixel MSE, None for the frame gap; `table` is the paper's, or None."""

    name: str
    title: str
    settings: tuple[int | float, ...]
    default: int | float
    parameter: str | None = None
    table: str | None = None


ABLATIONS: Final[tuple[Ablation, ...]] = (
    Ablation(
        name="bins",
        title="Scale bins",
        settings=(25, 50, 75, 100, 125, 150),
        default=125,
        parameter="bins",
        table="ablation-scale-bins-pixel-mse",
    ),
    Ablation(
        name="frame-gap",
        title="Frame gap",
        settings=(1, 2, 3, 4, 5),
        default=FRAME_GAP,
        table="ablation-frame-gap",
    ),
    Ablation(
        name="shift",
        title="Maximum shift of the centre",
        settings=(0, 1, 2, 3, 4),
        default=3,
        parameter="shift",
        table="ablation-center-shift",
    ),
    Ablation(
        name="expansion",
        title="Expansion of the boxes",
        settings=(0.9, 1.0, 1.1, 1.2, 1.4),
        default=1.1,
        parameter="expand",
    ),
)


@dataclass(frozen=True, slots=True)
class AblationRow:
    """The scores of one setting by metric, and the paper's; None if absent. `n_fallback` have a fallback."""

    setting: int | float
    scores: Mapping[str, float | None]
    published: Mapping[str, float | None]
    n_fallback: int


def get_ablation(name: str) -> Ablation:
    """Return the ablation with this name; raises `KeyError`."""
    return {ablation.name: ablation for ablation in ABLATIONS}[name]


def scores_of_settings(
    ablation: Ablation,
    *,
    folder: SequenceFolder,
    truth: GroundTruth,
    parameters: Mapping[str, Value] | None = None,
    n_processes: int = 1,
    progress: Callable[[int], None] = lambda _n_done: None,
) -> list[AblationRow]:
    """Score each setting; `parameters` are further ones of Pixel MSE that differ from the default.

    `progress` gets the number of finished estimates of `n_sequences × n_settings`. Raises `Rejected` for an
    unusable folder, and for a truth with other sequences.
    """
    order = _order(folder, truth)
    rows: list[AblationRow] = []
    for number, setting in enumerate(ablation.settings):
        frame_gap = FRAME_GAP if ablation.parameter else int(setting)
        varied = {ablation.parameter: setting} if ablation.parameter else {}
        n_before = number * folder.n_sequences
        if not ablation.parameter and not _has_boxes(folder, frame_gap):
            rows.append(_row(ablation, setting, dict.fromkeys(METRICS), folder.n_sequences))
            progress(n_before + folder.n_sequences)
            continue
        outcomes = _outcomes(
            folder,
            {**(parameters or {}), **varied},
            frame_gap,
            n_processes,
            partial(_report, progress, n_before),
        )
        n_fallback = sum(outcome.reason is not None for outcome in outcomes)
        rows.append(_row(ablation, setting, _scores(outcomes, order, truth, frame_gap), n_fallback))
    return rows


def _report(progress: Callable[[int], None], n_before: int, n_done: int) -> None:
    progress(n_before + n_done)


def _order(folder: SequenceFolder, truth: GroundTruth) -> list[int]:
    row_of = {anno_id: row for row, anno_id in enumerate(folder.manifest.anno_id.tolist())}
    wanted = truth.manifest.anno_id.tolist()
    different = sorted(set(wanted) ^ set(row_of))
    if different:
        message = (
            f"{counted(len(different), 'sequence is', 'sequences are')} only in the ground truth or "
            f"only in the folder, the first is {different[0]}; expected the same sequences in both."
        )
        raise reject("missing-keys", message)
    return [row_of[anno_id] for anno_id in wanted]


def _has_boxes(folder: SequenceFolder, frame_gap: int) -> bool:
    return bool(np.isfinite(folder.boxes[:, TARGET - frame_gap]).all(axis=1).any())


def _outcomes(
    folder: SequenceFolder,
    parameters: Mapping[str, Value],
    frame_gap: int,
    n_processes: int,
    progress: Callable[[int], None],
) -> list[Outcome]:
    method = get_method(METHOD)
    filled = method.filled(parameters)
    require_usable(folder, method=method, frame_gap=frame_gap)
    make = partial(SequenceEstimator, folder=folder, method=method, parameters=filled, frame_gap=frame_gap)
    outcomes: dict[int, Outcome] = {}
    rows = folder.rows_in_time().tolist()
    with closing(worked_through(make, rows, n_processes=n_processes)) as pieces:
        for piece in pieces:
            outcomes |= {outcome.row: outcome for outcome in piece}
            progress(len(outcomes))
    return [outcomes[row] for row in range(folder.n_sequences)]


def _scores(
    outcomes: list[Outcome], order: list[int], truth: GroundTruth, frame_gap: int
) -> dict[str, float | None]:
    scale_ratio = [outcomes[row].scale_ratio for row in order]
    ttc_s = scale_ratio_to_ttc(scale_ratio, fps_hz=fps_of_gap(frame_gap))
    overall = evaluate(Predictions.from_arrays(ttc_s=ttc_s, manifest=truth.manifest), truth).scores["overall"]
    return {metric: overall.means[metric] for metric in METRICS}


def _row(
    ablation: Ablation, setting: int | float, scores: Mapping[str, float | None], n_fallback: int
) -> AblationRow:
    table = published_tables().table(ablation.table) if ablation.table else None
    published = {
        metric: table.value(method=METHOD, setting=setting, column=metric) if table else None
        for metric in METRICS
    }
    return AblationRow(setting, scores, published, n_fallback)
