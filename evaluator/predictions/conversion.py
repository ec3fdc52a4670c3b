"""Conversion of a prediction file to another unit or frame rate."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from evaluator.arguments import Source, data_of
from evaluator.counting import counted
from evaluator.metrics.scale import (
    FRAME_RATE_HZ,
    N_FRAMES,
    Floats,
    fps_of_gap,
    scale_ratio_to_ttc,
    ttc_to_scale_ratio,
)
from evaluator.predictions.alignment import (
    Fault,
    PointerOf,
    column,
    fault_of,
    rates_of,
    require_once,
)
from evaluator.predictions.documents import Document, Members, Unit, parse, read_document
from evaluator.predictions.loading import json_of
from evaluator.predictions.parquet import as_sent
from evaluator.predictions.values import broken_rule
from evaluator.predictions.writing import write_predictions
from evaluator.problems import Findings, listed, quoted


def convert(
    source: Source,
    *,
    to: Unit = "ttc",
    fps_hz: float | None = None,
    frame_gap: int | None = None,
    to_fps_hz: float | None = None,
    to_frame_gap: int | None = None,
    natural_keys: Mapping[str, str] | None = None,
) -> bytes:
    """Convert a prediction file to the unit `to`.

    A flat file has seconds, or scale ratios at `fps_hz` or `frame_gap`; an envelope states its unit. Scale
    ratios are written at `to_fps_hz` or `to_frame_gap`, by default 2 Hz (gap 5). With
    `natural_keys`, natural keys by anno_id, the keys become natural keys; otherwise they stay. Raises
    `Rejected` for a file with faults or with other anno_ids than `natural_keys`, and `ValueError` for an
    impossible rate or more than one.
    """
    document = read_document(parse(json_of(as_sent(data_of(source)))))
    _require_one_rate(document, fps_hz, frame_gap)
    findings = Findings()
    names = [name for name, _ in document.predictions]
    require_once(names, findings, document.pointer)
    if natural_keys is not None:
        _require_anno_ids(names, natural_keys, findings, document.pointer)
    is_ratio = document.unit == "scale_ratio" or fps_hz is not None or frame_gap is not None
    fault = fault_of("scale_ratio" if is_ratio else "ttc")
    values = column(document.predictions, range(len(names)), findings, document.pointer, fault, n=len(names))
    rates: Floats | None = None
    if document.unit == "scale_ratio":
        rates = _rates(document, names, findings)
    elif is_ratio:
        rates = np.asarray(fps_hz if fps_hz is not None else fps_of_gap(_gap(frame_gap)))
    findings.raise_if_any()
    ttc_s = values if rates is None else scale_ratio_to_ttc(values, fps_hz=rates)
    meta = document.meta
    if natural_keys is not None:
        names = [natural_keys[name] for name in names]
    if to == "ttc":
        return write_predictions(keys=names, ttc_s=ttc_s, meta=meta)
    if to_fps_hz is None and to_frame_gap is None:
        to_frame_gap = N_FRAMES - 1
    new_hz = to_fps_hz if to_fps_hz is not None else FRAME_RATE_HZ / _gap(to_frame_gap)
    ratios = ttc_to_scale_ratio(ttc_s, fps_hz=new_hz)
    _require_ratios(ratios, ttc_s, document, names, fps_hz=new_hz)
    return write_predictions(
        keys=names, scale_ratio=ratios, fps_hz=to_fps_hz, frame_gap=to_frame_gap, meta=meta
    )


def _require_ratios(
    ratios: Floats, ttc_s: Floats, document: Document, names: list[str], *, fps_hz: float
) -> None:
    """Raise `Rejected` for times without a scale ratio at this rate, with a gap that has one."""
    # α > 0 needs τ > 0 or τ < −1 / f: otherwise the object was at the observer's plane within the gap.
    findings = Findings()
    limit_s = 1 / fps_hz
    for row in np.flatnonzero(~(ratios > 0)).tolist():
        value = float(ttc_s[row])
        gaps = [gap for gap in range(1, N_FRAMES) if value < -gap / FRAME_RATE_HZ]
        fits = f"--to-frame-gap {gaps[-1]} (or less) has one" if gaps else "no frame gap has one"
        message = (
            f"The time to contact is {value:g} s, which has no scale ratio at {fps_hz:g} Hz: an object that "
            f"moves away needs more than {limit_s:g} s, the time between both frames; {fits}."
        )
        rule = broken_rule(value, unit="ttc")
        code, message = (rule.code, rule.message(value)) if rule else ("not-positive", message)
        findings.add(code, message, document.pointer(names[row]))
    findings.raise_if_any()


def _require_one_rate(document: Document, fps_hz: float | None, frame_gap: int | None) -> None:
    if fps_hz is not None and frame_gap is not None:
        raise ValueError("Give either fps_hz or frame_gap.")
    if document.enveloped and (fps_hz is not None or frame_gap is not None):
        raise ValueError(
            "The file says itself what its unit and rate are; give neither fps_hz nor frame_gap."
        )


def _gap(frame_gap: int | None) -> int:
    if frame_gap is None or frame_gap not in range(1, N_FRAMES):
        raise ValueError(f"The frame gap is {frame_gap}; expected 1 to {N_FRAMES - 1}.")
    return frame_gap


def _require_anno_ids(
    names: list[str], natural_keys: Mapping[str, str], findings: Findings, pointer_of: PointerOf
) -> None:
    if names and set(natural_keys.values()).issuperset(names):
        message = (
            f"The {len(names):,} keys are natural keys already; expected anno_ids of the toolkit. "
            "The file needs no annotations: it can be sent as it is."
        )
        findings.group("unknown-keys", message, pointer_of(names[0]), n_faults=len(names))
        return
    given = set(names)
    n_in_folder = counted(len(natural_keys), "sequence")
    counts = f"The file has {counted(len(given), 'anno_id')} and the folder {n_in_folder}"
    unknown = [name for name in given if name not in natural_keys]
    missing = [key for key in natural_keys if key not in given]
    if unknown:
        expected = f"expected the anno_ids 0 to {len(natural_keys) - 1}"
        shown = listed([quoted(name) for name in sorted(unknown)])
        message = f"{counts}; no sequence for {len(unknown):,} of the anno_ids: {shown}; {expected}."
        findings.group("unknown-keys", message, pointer_of(min(unknown)), n_faults=len(unknown))
    if missing:
        message = (
            f"{counts}; no value for {len(missing):,} of the sequences: {listed(missing)}; "
            "expected one for each, from the folder that the toolkit has read."
        )
        findings.group("missing-keys", message, pointer_of(missing[0]), n_faults=len(missing))


def _rates(document: Document, names: list[str], findings: Findings) -> Floats:
    def by_key(members: Members, pointer_of: PointerOf, fault: Fault) -> Floats:
        given = dict(members)
        missing = [key for key in names if key not in given]
        if missing:
            message = (
                f"{len(missing):,} keys have no {document.rate_name}: {listed(missing)}; "
                "expected one for each prediction."
            )
            findings.group("missing-keys", message, pointer_of(missing[0]), n_faults=len(missing))
        row_of = {name: row for row, name in enumerate(names)}
        rows = [row_of.get(key) for key, _ in members]
        return column(members, rows, findings, pointer_of, fault, n=len(names))

    return rates_of(document, findings, by_key)
