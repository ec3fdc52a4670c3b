"""Scores of groups of sequences: by recording, camera, TTC range, occlusion, lane and size of the box."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Final, Literal, cast

import numpy as np
from numpy.typing import NDArray

from evaluator.metrics.protocol import OVERALL, score_name
from evaluator.metrics.scale import Floats
from evaluator.scoring.results import Details, GroupScores
from evaluator.scoring.uncertainty import bootstrap_of, by_units
from evaluator.truth.ground_truth import GroundTruth

CURVE_EDGES_S: Final = (
    -20,
    -15,
    -10,
    -8,
    -6,
    -4,
    -3,
    -2,
    -1,
    0,
    0.5,
    1,
    1.5,
    2,
    2.5,
    3,
    4,
    5,
    6,
    8,
    10,
    12,
    15,
    20,
)
"""Edges of the true time to contact in seconds, the ends of the paper's ranges among them."""

GroupName = Literal["recording", "camera", "range", "occlusion", "lane", "box-size", "box_size"]

NOT_STATED: Final = "not stated"

Rows = NDArray[np.intp]
Ends = tuple[float, float]


def scores_of(
    details: Details,
    *,
    groups: Mapping[str, Rows],
    has_ranges: bool = True,
    with_intervals: bool = False,
    unit: str | None = None,
) -> list[GroupScores]:
    manifest, ttc_s, errors = details.truth.manifest, details.truth.ttc_s, details.errors
    masks = {OVERALL: np.ones(len(ttc_s), dtype=bool)}
    for ttc_range in details.protocol.ranges if has_ranges else ():
        masks[ttc_range.name] = ttc_range.contains(ttc_s)
    names = [score_name(metric, name) for metric in errors for name in masks]
    group_means = []
    sums, counts = list[Floats](), list[Floats]()
    for group, rows in groups.items():
        parts = {name: rows[mask[rows]] for name, mask in masks.items()}
        means = {
            score_name(metric, name): float(values[part].mean()) if len(part) else None
            for metric, values in errors.items()
            for name, part in parts.items()
        }
        group_means.append((group, rows, means))
        if with_intervals:
            for values in errors.values():
                for part in parts.values():
                    recordings, n = manifest.recording_index[part], manifest.n_recordings
                    sums.append(np.bincount(recordings, weights=values[part], minlength=n).astype(np.float64))
                    counts.append(np.bincount(recordings, minlength=n).astype(np.float64))
    ends = _intervals(details.truth, sums, counts, unit=unit)
    return [
        GroupScores(
            group,
            len(rows),
            len(np.unique(manifest.recording_index[rows])),
            means,
            dict(zip(names, ends[number * len(names) :], strict=False)) or dict.fromkeys(names),
        )
        for number, (group, rows, means) in enumerate(group_means)
    ]


def _intervals(
    truth: GroundTruth, sums: Sequence[Floats], counts: Sequence[Floats], *, unit: str | None
) -> list[Ends | None]:
    if not sums:
        return []
    units = truth.manifest.units_by(unit)
    columns, rows = (by_units(np.stack(each, axis=1), units) for each in (counts, sums))
    low, high = bootstrap_of(truth.digest, columns).intervals(rows[None])
    return [
        (one, other) if np.isfinite(one) else None
        for one, other in zip(low[0].tolist(), high[0].tolist(), strict=True)
    ]


# --- the groups ---------------------------------------------------------------------------------------------


def group_name(by: str) -> GroupName:
    """Return the name of a group in its first spelling. Raises `ValueError`, and `TypeError` for no text."""
    expected = f"expected one of {', '.join(GROUPS)}"
    if not isinstance(by, str):
        raise TypeError(f"The group is of type {type(by).__name__}; {expected}.")
    name = by.replace("_", "-")
    if name not in GROUPS:
        raise ValueError(f"Unknown group {by!r}; {expected}.")
    return cast("GroupName", name)


def groups_of(details: Details, *, by: str) -> dict[str, Rows]:
    """Return the rows of every non-empty group. Raises `ValueError` as `Report.breakdown` does."""
    by = group_name(by)
    return {name: rows for name, rows in GROUPS[by](details).items() if len(rows)}


def curve_of(details: Details) -> dict[Ends, Rows]:
    """Return the rows of every non-empty bin [low, high) of true times, by its ends in seconds."""
    bins = np.digitize(details.truth.ttc_s, CURVE_EDGES_S)
    ends = itertools.pairwise(CURVE_EDGES_S)
    rows_of_bin = {pair: np.flatnonzero(bins == number) for number, pair in enumerate(ends, 1)}
    return {pair: rows for pair, rows in rows_of_bin.items() if len(rows)}


def _by_name(names: Sequence[str]) -> dict[str, Rows]:
    groups, index = np.unique(np.array(names), return_inverse=True)
    order = np.argsort(index, kind="stable")
    ends = np.cumsum(np.bincount(index))[:-1]
    return dict(zip(groups.tolist(), np.split(order, ends), strict=True))


def _by_range(details: Details) -> dict[str, Rows]:
    ttc_s, left = details.truth.ttc_s, np.ones(details.truth.n_sequences, dtype=bool)
    groups = {}
    for ttc_range in details.protocol.ranges:
        inside = ttc_range.contains(ttc_s)
        groups[f"{ttc_range.name} {ttc_range.seconds}"] = np.flatnonzero(inside)
        left &= ~inside
    return groups | {"in no range": np.flatnonzero(left)}


def _by_occlusion(details: Details) -> dict[str, Rows]:
    values = _stated(details.truth.objects.occ_ratio, "occ_ratio")
    return {
        "0%": np.flatnonzero(values == 0),
        **{
            f"{100 * low:g}–{100 * high:g}%": np.flatnonzero((values > low) & (values <= high))
            for low, high in ((0.0, 0.25), (0.25, 0.5), (0.5, 1.0))
        },
        NOT_STATED: np.flatnonzero(np.isnan(values)),
    }


def _by_lane(details: Details) -> dict[str, Rows]:
    values = _stated(details.truth.objects.same_lane, "same_lane")
    return {
        "same lane": np.flatnonzero(values == 1),
        "other lane": np.flatnonzero(values == 0),
        NOT_STATED: np.flatnonzero(np.isnan(values)),
    }


def _by_box_size(details: Details) -> dict[str, Rows]:
    values = _stated(details.truth.objects.box_height, "box2d")
    edges = (0.0, 0.05, 0.1, 0.2, 0.4)
    return {
        **{
            f"{100 * low:g}–{100 * high:g}%": np.flatnonzero((values > low) & (values <= high))
            for low, high in itertools.pairwise(edges)
        },
        f"over {100 * edges[-1]:g}%": np.flatnonzero(values > edges[-1]),
        NOT_STATED: np.flatnonzero(np.isnan(values)),
    }


def _stated(values: Floats | None, column: str) -> Floats:
    if values is None:
        raise ValueError(
            f"The ground truth does not state {column}; expected a table with this column, "
            "or the annotation folder."
        )
    return values


GROUPS: Final[dict[str, Callable[[Details], dict[str, Rows]]]] = {
    "recording": lambda details: _by_name(details.truth.manifest.bag_stamp),
    "camera": lambda details: _by_name(details.truth.manifest.cam_id),
    "range": _by_range,
    "occlusion": _by_occlusion,
    "lane": _by_lane,
    "box-size": _by_box_size,
}
"""What sequences can be grouped by."""
