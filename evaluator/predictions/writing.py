"""Writing prediction files from arrays."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any, get_args

import numpy as np
from numpy.typing import ArrayLike

from evaluator.arguments import require
from evaluator.arrays import in_row_order
from evaluator.counting import counted
from evaluator.metrics.scale import N_FRAMES, Floats, fps_of_gap
from evaluator.predictions.documents import Unit, parse, read_document
from evaluator.predictions.values import allowed, broken_rule
from evaluator.problems import Findings, pointer, quoted
from evaluator.truth.ground_truth import KeyKind, Manifest


def write_predictions(
    path: str | os.PathLike[str] | IO[bytes] | None = None,
    *,
    manifest: Manifest | None = None,
    keys: Sequence[str | int] | KeyKind | None = None,
    ttc_s: ArrayLike | None = None,
    scale_ratio: ArrayLike | None = None,
    fps_hz: float | None = None,
    frame_gap: int | None = None,
    meta: Mapping[str, object] | None = None,
) -> bytes:
    """Write a valid prediction file; returns its bytes, and writes them to `path` or an open file if given.

    The values are an array `(n,)`: `ttc_s` in seconds, or `scale_ratio` with `fps_hz` or `frame_gap`. They
    have the order of `manifest`, or of `keys`, a list, if you have no manifest. With a manifest the file has
    natural keys, which mean the same in every edition; `keys="anno_id"` writes the numbers that the dataset's
    toolkit reads. Every float64 reads back exactly.

    Seconds without `meta` are written in the flat form, anything else as an envelope. Raises `ValueError` for
    a wrong combination of arguments, `Rejected` for values that no file may hold.
    """
    values = _values(ttc_s, scale_ratio, manifest)
    names = _names(manifest, keys, n_values=len(values))
    header = _header(ttc_s is None, fps_hz, frame_gap)
    require_values(values, names, is_ratio=ttc_s is None)
    predictions = dict(zip(names, values.tolist(), strict=True))
    document: dict[str, object] = dict(predictions)
    if ttc_s is None or meta is not None:
        document = {**header, **({} if meta is None else {"meta": dict(meta)}), "predictions": predictions}
    data = json.dumps(document, separators=(",", ":")).encode()
    if meta is not None:
        # What the reader would refuse is refused before it is written.
        read_document(parse(data))
    if isinstance(path, str | os.PathLike):
        Path(path).write_bytes(data)
    elif path is not None:
        path.write(data)
    return data


def template(manifest: Manifest) -> bytes:
    """Write a file to fill in: `null`, which is refused, for every sequence, by natural key."""
    members = ",\n".join(f"{json.dumps(name)}: null" for name in manifest.keys_of())
    return f"{{\n{members}\n}}\n".encode()


def _values(ttc_s: ArrayLike | None, scale_ratio: ArrayLike | None, manifest: Manifest | None) -> Floats:
    if (ttc_s is None) == (scale_ratio is None):
        raise ValueError("Give either ttc_s or scale_ratio.")
    name, given = ("scale_ratio", scale_ratio) if ttc_s is None else ("ttc_s", ttc_s)
    values = in_row_order(given, name=name, anno_id=None if manifest is None else manifest.anno_id)
    if values.ndim != 1:
        raise ValueError(f"The values have the shape {values.shape}; expected (n,).")
    return values


def _names(
    manifest: Manifest | None, keys: Sequence[str | int] | KeyKind | None, *, n_values: int
) -> Sequence[str]:
    if isinstance(keys, str):
        if manifest is None or keys not in get_args(KeyKind):
            message = (
                f'keys is {quoted(keys)}; expected "natural_key" or "anno_id" with a manifest, or a list'
            )
            raise ValueError(f"{message} of keys without one.")
    elif (manifest is None) == (keys is None):
        raise ValueError("Give either manifest or keys.")
    if manifest is not None:
        require(manifest, Manifest, name="manifest")
        names = manifest.keys_of("anno_id" if keys == "anno_id" else "natural_key")
    else:
        names = tuple(map(str, () if keys is None else keys))
    if len(names) != n_values:
        raise ValueError(f"Found {counted(n_values, 'value')} for {counted(len(names), 'sequence')}.")
    if len(set(names)) != len(names):
        raise ValueError("The keys are not distinct.")
    return names


def require_values(values: Floats, names: Sequence[str], *, is_ratio: bool) -> None:
    """Raise `Rejected`, by the names of sequences, for values that no file may hold."""
    findings = Findings()
    unit: Unit = "scale_ratio" if is_ratio else "ttc"
    for row in np.flatnonzero(~allowed(values, unit=unit)).tolist():
        if rule := broken_rule(values[row], unit=unit):
            message = f"The value of {quoted(names[row])} is {values[row]!s}; expected {rule.expected}."
            findings.add(rule.code, message, pointer(names[row]))
    findings.raise_if_any()


def rate_of(*, is_ratio: bool, fps_hz: float | None, frame_gap: int | None) -> float | None:
    """Return the rate in Hz, None for seconds; raises `ValueError` as `write_predictions` does."""
    header = _header(is_ratio, fps_hz, frame_gap)
    if not is_ratio:
        return None
    return float(fps_of_gap(frame_gap)) if frame_gap is not None else float(str(header["fps"]))


def _header(is_ratio: bool, fps_hz: float | None, frame_gap: int | None) -> dict[str, object]:
    if not is_ratio:
        if fps_hz is not None or frame_gap is not None:
            raise ValueError("Times to contact have no rate; give fps_hz or frame_gap with scale_ratio only.")
        return {"unit": "ttc"}
    if (fps_hz is None) == (frame_gap is None):
        raise ValueError("Scale ratios need either fps_hz or frame_gap.")
    rate: Any
    name, rate = ("frame_gap", frame_gap) if fps_hz is None else ("fps_hz", fps_hz)
    if n_values := np.size(rate) if np.ndim(rate) else 0:
        raise ValueError(f"{name} has {n_values} values; expected one number for all sequences.")
    if fps_hz is not None:
        if not 0 < fps_hz < float("inf"):
            raise ValueError(f"fps_hz is {fps_hz}; expected a finite number greater than 0.")
        return {"unit": "scale_ratio", "fps": float(fps_hz)}
    if frame_gap is None or frame_gap not in range(1, N_FRAMES):
        raise ValueError(f"frame_gap is {frame_gap}; expected 1 to {N_FRAMES - 1}.")
    return {"unit": "scale_ratio", "frame_gap": int(frame_gap)}
