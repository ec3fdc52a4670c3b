"""Pandas frames in and out, for those who keep their predictions so; needs pandas."""

from __future__ import annotations

import json
from typing import Any, Final

import pandas as pd

from evaluator.arguments import require
from evaluator.arrays import as_floats
from evaluator.predictions import slips
from evaluator.predictions.headers import NAMES, NATURAL_KEY, RATES
from evaluator.predictions.loading import Predictions, read_predictions
from evaluator.truth.csv_tables import require_one_column
from evaluator.truth.ground_truth import Manifest

RATIO: Final = "scale_ratio"


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


def predictions_from_frame(
    frame: pd.DataFrame, *, manifest: Manifest, column: str | None = None
) -> Predictions:
    """Read predictions from a frame with one row per sequence, in any order, as a CSV table has them.

    Values are seconds in `column`, by default `ttc_s`, else `ttc`; or scale ratios in `scale_ratio`, with a
    column `fps` or `frame_gap`. Keys are the columns `bag_stamp`, `cam_id`, `ts` and `track_id`, else
    `anno_id` (a column or the index). Raises `Rejected` as for a file, `ValueError` for a frame without keys
    or rates, `KeyError` for a missing column, `TypeError` for one of texts or other things than real numbers.
    """
    require(frame, pd.DataFrame, name="frame")
    names = list(map(str, frame.columns))
    if column is None:
        column = _value_column(names)
    if column not in frame.columns:
        raise KeyError(f"The frame has no column {column!r}; found {', '.join(names)}.")
    rates = [name for name in RATES if name in names] if column == RATIO else []
    if column == RATIO and len(rates) != 1:
        raise ValueError(
            f"The column {RATIO!r} needs one column fps or frame_gap; found {', '.join(names)}. To read "
            "it as seconds, rename it."
        )
    require_one_column(names, (*NATURAL_KEY, "anno_id", column, *rates), where="")
    keys = [json.dumps(str(key)) for key in _keys(frame)]
    predictions, *rest = (
        "{" + ",".join(f"{key}:{json.dumps(value)}" for key, value in zip(keys, each, strict=True)) + "}"
        for each in (_numbers(frame[name], name=name) for name in (column, *rates))
    )
    if not rates:
        return read_predictions(predictions.encode(), manifest=manifest)
    document = f'{{"unit":"{RATIO}","{rates[0]}":{rest[0]},"predictions":{predictions}}}'
    return read_predictions(document.encode(), manifest=manifest)


def _numbers(values: pd.Series[Any], *, name: str) -> Any:
    """Convert a column (n,) to float64, NaN where it has no value."""
    kinds = pd.api.types
    is_real = kinds.is_numeric_dtype(values) and not (
        kinds.is_bool_dtype(values) or kinds.is_complex_dtype(values)
    )
    if is_real:
        return values.astype("float64")
    try:
        return as_floats(list(values)).tolist()
    except (TypeError, ValueError) as fault:
        raise TypeError(f"In the column {name!r}: {fault}") from None


def _value_column(names: list[str]) -> str:
    # A frame of the ground truth, with the predictions beside it, has `ttc` too.
    values = [name for name in ("ttc_s", "ttc", RATIO) if name in names]
    if not values or slips.predicted_among([name for name in names if name not in NAMES]):
        raise KeyError(
            f"The frame has the columns {', '.join(names)}; expected ttc_s, ttc or {RATIO}, or column= with "
            "the name of another one."
        )
    return values[0]


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
