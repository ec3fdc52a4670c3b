"""Pandas frames in and out, for those who keep their predictions so; needs `pip install .[frames]`."""

from __future__ import annotations

import json

import pandas as pd

from evaluator.predictions.predictions import Predictions, read_predictions
from evaluator.truth.truth import Manifest


def manifest_frame(manifest: Manifest) -> pd.DataFrame:
    """The manifest as a frame of n rows, indexed by anno_id: what to join one's own results to."""
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
    """Predictions from a frame with one row per sequence, in any order: seconds in `column`.

    The sequence is named by the column `anno_id`, or by the index. Raises `Rejected` in the words that a file
    with these values would get, `KeyError` for a column that is not there.
    """
    keys = frame["anno_id"] if "anno_id" in frame.columns else frame.index
    pairs = zip(keys, frame[column].astype("float64"), strict=True)
    members = ",".join(f"{json.dumps(str(key))}:{json.dumps(value)}" for key, value in pairs)
    return read_predictions(f"{{{members}}}".encode(), manifest=manifest)
