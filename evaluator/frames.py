"""Pandas frames in and out, for those who keep their predictions so; needs pandas."""

from __future__ import annotations

import json
from typing import Any

import pandas as pd

from evaluator.arguments import require
from evaluator.predictions.loading import NATURAL_KEY, Predictions, read_predictions
from evaluator.truth.ground_truth import Manifest


def manifest_frame(manifest: Manifest) -> pd.DataFrame:
    """Return the manifest as a frame of n rows, indexed by anno_id, to join results to."""
    return pd.DataFrame(
        {
            "bag_stamp": manifest.bag_stamp,
            "cam_id": manifest.cam_id,
            "ts": manifest.ts_ns,
            "track_id": manifest.track_id,
        },
        index=pd.Index(manifest.anno_id, name="anno_id"),
    )


def predictions_from_frame(frame: pd.DataFrame, *, manifest: Manifest, column: str = "ttc_s") -> Predictions:
    """Read predictions from a frame with one row per sequence, in any order: seconds in `column`.

    Keys are the columns `bag_stamp`, `cam_id`, `ts` and `track_id`, else `anno_id` (a column or the index).
    Raises `Rejected` as for a file, `ValueError` for a frame without keys, `KeyError` for a missing column.
    """
    require(frame, pd.DataFrame, name="frame")
    if column not in frame.columns:
        raise KeyError(f"The frame has no column {column!r}; found {', '.join(map(str, frame.columns))}.")
    pairs = zip(_keys(frame), frame[column].astype("float64"), strict=True)
    members = ",".join(f"{json.dumps(str(key))}:{json.dumps(value)}" for key, value in pairs)
    return read_predictions(f"{{{members}}}".encode(), manifest=manifest)


def _keys(frame: pd.DataFrame) -> list[Any]:
    if set(NATURAL_KEY) <= set(frame.columns):
        columns = zip(*(frame[name].astype(str) for name in NATURAL_KEY), strict=True)
        return list(map("/".join, columns))
    if "anno_id" in frame.columns:
        return list(frame["anno_id"])
    if frame.index.name == "anno_id":
        return list(frame.index)
    # Row numbers of a frame that somebody has sorted or shuffled name other sequences.
    raise ValueError(
        f"The frame does not name the sequences; expected the columns {', '.join(NATURAL_KEY)}, or anno_id "
        "as a column or as the name of the index."
    )
