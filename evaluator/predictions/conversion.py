"""Conversion of a prediction file to another unit or frame rate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

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
from evaluator.problems import Findings, listed, quoted, reject
from evaluator.truth.ground_truth import Manifest


def convert(
    source: Source,
    *,
    to: Unit = "ttc",
    fps_hz: float | None = None,
    frame_gap: int | None = None,
    to_fps_hz: float | None = None,
    to_frame_gap: int | None = None,
    natural_keys: Mapping[str, str] | None = None,
    manifest: Manifest | None = None,
    to_manifest: Manifest | None = None,
) -> bytes:
    """Convert a prediction file to the unit `to`.

    A flat file has seconds, or scale ratios at `fps_hz` or `frame_gap`; an envelope states its unit. Scale
    ratios are written at `to_fps_hz` or `to_frame_gap`, by default 2 Hz (gap 5).

    With `manifest`, for which the file was made, anno_ids become natural keys; with `natural_keys`, natural
    keys by anno_id, those of the toolkit do. Otherwise keys stay. `to_manifest` leaves out the sequences
    that it does not have. Raises `Rejected` for a file with faults or with other anno_ids, `ValueError` for
    an impossible rate, or more than one rate or source of keys.
    """
    keys = _keys(natural_keys, manifest)
    document = read_document(parse(json_of(as_sent(data_of(source)))))
    _require_one_rate(document, fps_hz, frame_gap)
    findings = Findings()
    names = [name for name, _ in document.predictions]
    require_once(names, findings, document.pointer)
    if keys is not None:
        _require_anno_ids(names, keys, findings, document.pointer)
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
    if keys is not None:
        names = [keys.natural_keys[name] for name in names]
    if to_manifest is not None:
        kept = _kept(names, to_manifest, document.pointer)
        names, ttc_s = [names[row] for row in kept], ttc_s[kept]
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


@dataclass(frozen=True, slots=True)
class _Keys:
    """Natural keys by anno_id, and the words for where they come from."""

    natural_keys: Mapping[str, str]
    source: str
    owner: str
    expected: str


def _keys(natural_keys: Mapping[str, str] | None, manifest: Manifest | None) -> _Keys | None:
    if manifest is None:
        if natural_keys is None:
            return None
        return _Keys(natural_keys, "folder", "toolkit", "from the folder that the toolkit has read")
    if natural_keys is not None:
        raise ValueError("Give either manifest or natural_keys.")
    of_manifest = dict(zip(manifest.anno_id_keys, manifest.natural_keys, strict=True))
    return _Keys(of_manifest, "manifest", "manifest", "and the manifest for which the file was made")


def _kept(names: list[str], manifest: Manifest, pointer_of: PointerOf) -> list[int]:
    """Return the rows whose natural key the manifest has; raises `Rejected` where there is none."""
    kept = [row for row, name in enumerate(names) if name in manifest.row_of_natural_key]
    if not kept:
        message = (
            f"None of the {len(names):,} keys is a natural key of the manifest, such as "
            f"{quoted(manifest.natural_keys[0])}; expected natural keys, or also the manifest for which the "
            "file was made."
        )
        raise reject("unknown-keys", message, pointer_of(names[0]) if names else "")
    return kept


def _require_anno_ids(names: list[str], keys: _Keys, findings: Findings, pointer_of: PointerOf) -> None:
    natural_keys = keys.natural_keys
    if names and set(natural_keys.values()).issuperset(names):
        message = (
            f"The {len(names):,} keys are natural keys already; expected anno_ids of the {keys.owner}. "
            "The file needs no conversion of its keys."
        )
        findings.group("unknown-keys", message, pointer_of(names[0]), n_faults=len(names))
        return
    given = set(names)
    n_there = counted(len(natural_keys), "sequence")
    counts = f"The file has {counted(len(given), 'anno_id')} and the {keys.source} {n_there}"
    unknown = [name for name in given if name not in natural_keys]
    missing = [key for key in natural_keys if key not in given]
    if unknown:
        ends = [min(natural_keys, key=int), max(natural_keys, key=int)]
        expected = f"expected the anno_ids {' to '.join(ends)}"
        shown = listed([quoted(name) for name in sorted(unknown)])
        message = f"{counts}; no sequence for {len(unknown):,} of the anno_ids: {shown}; {expected}."
        findings.group("unknown-keys", message, pointer_of(min(unknown)), n_faults=len(unknown))
    if missing:
        message = (
            f"{counts}; no value for {len(missing):,} of the sequences: {listed(missing)}; "
            f"expected one for each, {keys.expected}."
        )
        findings.group("missing-keys", message, pointer_of(missing[0]), n_faults=len(missing))


def _rates(document: Document, names: list[str], findings: Findings) -> Floats:
    row_of = {name: row for row, name in enumerate(names)}

    def by_key(members: Members, pointer_of: PointerOf, fault: Fault) -> Floats:
        given = dict(members)
        require_once([key for key, _ in members], findings, pointer_of)
        unknown = [key for key in given if key not in row_of]
        if unknown:
            message = (
                f"{len(unknown):,} keys of {document.rate_name} have no prediction: "
                f"{listed([quoted(key) for key in unknown])}; expected a rate for each prediction alone."
            )
            findings.group("unknown-keys", message, pointer_of(unknown[0]), n_faults=len(unknown))
        missing = [key for key in names if key not in given]
        if missing:
            message = (
                f"{len(missing):,} keys have no {document.rate_name}: {listed(missing)}; "
                "expected one for each prediction."
            )
            findings.group("missing-keys", message, pointer_of(missing[0]), n_faults=len(missing))
        rows = [row_of.get(key) for key, _ in members]
        return column(members, rows, findings, pointer_of, fault, n=len(names))

    return rates_of(document, findings, by_key)
