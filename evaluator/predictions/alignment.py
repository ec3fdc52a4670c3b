"""From parsed members to values in the manifest's order, with every fault in words."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, TypeGuard

import numpy as np

from evaluator.metrics.scale import N_FRAMES, Floats, fps_of_gap, scale_ratio_to_ttc
from evaluator.predictions import misspelt, slips
from evaluator.predictions.documents import Document, Members, Unit, kind_of, parse, read_document
from evaluator.predictions.values import RULES, allowed, broken_rule
from evaluator.problems import Findings, listed, pointer, quoted, reject
from evaluator.truth.ground_truth import KeyKind, Manifest

PointerOf = Callable[[str], str]
"""The JSON pointer to the member of a name."""
Fault = Callable[[object], tuple[str, str] | None]
"""Code and message for a value that cannot be taken."""


@dataclass(frozen=True, slots=True, eq=False)
class Aligned:
    """A document without its predictions, and these as seconds in the manifest's order."""

    document: Document
    ttc_s: Floats
    keys: KeyKind


def read_slowly(data: bytes, manifest: Manifest) -> Aligned:
    # A value and a rate for each sequence, meta, and enough more to name what is too much.
    max_members = 2 * manifest.n_sequences + 100_000
    document = read_document(parse(data, max_members=max_members))
    _require_filled(document.predictions, manifest)
    _require_flat(document.predictions, manifest)
    findings = Findings()
    keys = _check_keys(document.predictions, manifest, findings, document.pointer)
    values = _column(document.predictions, manifest, findings, document.pointer, fault_of(document.unit))
    if document.unit == "scale_ratio":
        fps_hz = read_rates(document, manifest, findings)
        names = manifest.keys_of(keys)
        ratios, values = values, scale_ratio_to_ttc(values, fps_hz=fps_hz)
        # NaN stands where the ratio or its rate has a fault of its own.
        for row in np.flatnonzero(~(allowed(values, unit="ttc") | np.isnan(values))).tolist():
            if rule := broken_rule(values[row], unit="ttc"):
                expected = rule.expected if values[row] else "one that is not 0"
                message = (
                    f"The scale ratio {ratios[row]!s} is a time to contact of {values[row]:g}; "
                    f"expected {expected}."
                )
                findings.add(rule.code, message, document.pointer(names[row]))
    findings.raise_if_any()
    return Aligned(document, values, keys)


def _require_filled(members: Members, manifest: Manifest) -> None:
    # A template sent as it came is one slip, not a problem for each sequence.
    if len(members) == manifest.n_sequences and all(value is None for _, value in members):
        message = (
            f"This is the empty template: all {len(members):,} values are null; "
            "expected a number for every sequence."
        )
        raise reject("not-a-number", message)


def _require_flat(members: Members, manifest: Manifest) -> None:
    """Refuse an object that names no sequence and has lists or objects, as frames and nested results do."""
    by_id, by_natural_key = manifest.row_of_id, manifest.row_of_natural_key
    if any(name in by_id or name in by_natural_key for name, _ in members):
        return
    for name, value in members:
        if isinstance(value, list):  # objects are lists of members
            message = (
                f"No key of the file names a sequence, and {quoted(name)} has {kind_of(value)}; expected one "
                'level of keys, {"KEY": NUMBER, …}, or an envelope with these as predictions.'
            )
            raise reject("wrong-top-level", message, pointer(name))


def read_rates(document: Document, manifest: Manifest, findings: Findings) -> Floats:
    def by_key(members: Members, pointer_of: PointerOf, fault: Fault) -> Floats:
        _check_keys(members, manifest, findings, pointer_of)
        return _column(members, manifest, findings, pointer_of, fault)

    return rates_of(document, findings, by_key)


def rates_of(
    document: Document, findings: Findings, by_key: Callable[[Members, PointerOf, Fault], Floats]
) -> Floats:
    """Read pair rates in Hz: (), or (n,) by `by_key`."""
    is_gap = document.rate_name == "frame_gap"
    fault = _gap_fault if is_gap else _fps_fault
    name = str(document.rate_name)
    if isinstance(document.rate, Members):
        rates = by_key(document.rate, lambda key: pointer(name, key), fault)
    else:
        problem = fault(document.rate)
        if problem:
            findings.add(problem[0], problem[1], f"/{name}")
        rates = np.array(math.nan if problem else document.rate, dtype=np.float64)
    return fps_of_gap(rates) if is_gap else rates


def _check_keys(members: Members, manifest: Manifest, findings: Findings, pointer_of: PointerOf) -> KeyKind:
    """Note missing, unknown, duplicate and mixed keys; return the most frequent kind."""
    by_id, by_natural_key = manifest.row_of_id, manifest.row_of_natural_key
    names = [name for name, _ in members]
    id_names = [name for name in names if name in by_id]
    natural_names = [name for name in names if name in by_natural_key]
    unknown = [name for name in names if name not in by_id and name not in by_natural_key]
    kind = _kind_of(id_names, natural_names, unknown)
    noun = "natural key" if kind == "natural_key" else "anno_id"
    if unknown:
        message = (
            f"{_n(len(unknown), 'key is', 'keys are')} not in the manifest: "
            f"{listed([quoted(name) for name in unknown])}; expected the manifest's anno_ids, as plain "
            "decimal numbers, or its natural keys, bag_stamp/cam_id/ts/track_id."
        )
        if hint := misspelt.advice(unknown, manifest):
            message = f"{message} {hint}"
        findings.group("unknown-keys", message, pointer_of(unknown[0]), n_faults=len(unknown))
    require_once(names, findings, pointer_of)
    if id_names and natural_names:
        rare = id_names if kind == "natural_key" else natural_names
        message = (
            f"The file mixes {len(id_names):,} anno_ids with {len(natural_names):,} natural keys; "
            f"the odd ones: {listed([quoted(name) for name in rare])}; expected one kind of key."
        )
        findings.group("mixed-keys", message, pointer_of(rare[0]), n_faults=len(rare))
    given = {by_id[name] for name in id_names} | {by_natural_key[name] for name in natural_names}
    n_missing = manifest.n_sequences - len(given)
    if n_missing:
        rows = [row for row in range(manifest.n_sequences) if row not in given]
        missing = [manifest.keys_of(kind)[row] for row in rows]
        message = (
            f"{_n(n_missing, 'sequence has', 'sequences have')} no value: "
            f"{_listed_rows(rows, manifest, kind=kind)}; "
            f"expected one for each of the manifest's {manifest.n_sequences:,} sequences, by {noun}."
        )
        if n_shifted := misspelt.shift(names, manifest):
            side = "high" if n_shifted > 0 else "low"
            message += (
                f" All anno_ids seem to be {abs(n_shifted):,} too {side}, so that values belong to other "
                f"sequences: {_COUNTED if n_shifted == 1 else _USE_NATURAL}"
            )
        findings.group("missing-keys", message, pointer_of(missing[0]), n_faults=n_missing)
    return kind


_USE_NATURAL: Final = "write natural keys."
_COUNTED: Final = "they are counted from 0. Better write natural keys."


def _kind_of(id_names: list[str], natural_names: list[str], unknown: list[str]) -> KeyKind:
    """Return the kind of the most keys: by the manifest, or by their form if it has none of them."""
    if not id_names and not natural_names:
        examined = unknown[: misspelt.MAX_EXAMINED]
        n_natural = sum(map(misspelt.is_natural, examined))
        return "natural_key" if 2 * n_natural > len(examined) else "anno_id"
    return "natural_key" if len(natural_names) > len(id_names) else "anno_id"


def _listed_rows(rows: list[int], manifest: Manifest, *, kind: KeyKind) -> str:
    """List sequences by key, and a whole recording as one item."""
    keys, recordings = manifest.keys_of(kind), manifest.bag_stamp
    n_given = Counter(recordings[row] for row in rows)
    n_all = Counter(recordings)
    whole = [name for name, n in n_given.items() if n == n_all[name] and n > 1]
    if len(rows) == manifest.n_sequences:
        whole = []  # the keys themselves show how the file should name the sequences
    items = [f"all {n_all[name]} sequences of {name}" for name in whole]
    rest = set(n_given) - set(whole)
    return listed([*items, *(keys[row] for row in rows if recordings[row] in rest)])


def _column(
    members: Members, manifest: Manifest, findings: Findings, pointer_of: PointerOf, fault: Fault
) -> Floats:
    by_id, by_natural_key = manifest.row_of_id, manifest.row_of_natural_key
    rows = [by_id.get(name, by_natural_key.get(name)) for name, _ in members]
    return column(members, rows, findings, pointer_of, fault, n=manifest.n_sequences)


def column(
    members: Members,
    rows: Iterable[int | None],
    findings: Findings,
    pointer_of: PointerOf,
    fault: Fault,
    *,
    n: int,
) -> Floats:
    """Align values (n,) by the row of each member, NaN where absent or unusable."""
    values = np.full(n, math.nan)
    for (name, value), row in zip(members, rows, strict=True):
        if problem := fault(value):
            findings.add(problem[0], problem[1], pointer_of(name))
        elif row is not None:
            values[row] = value
    return values


def fault_of(unit: Unit) -> Fault:
    expected = RULES[unit][0].expected

    def fault(value: object) -> tuple[str, str] | None:
        if not _is_number(value):
            sentence = f"The value is {kind_of(value)}; expected {expected}. {slips.of_value(value)}"
            return "not-a-number", sentence.rstrip()
        # As the columnar reading sees it, a long whole number too.
        rule = broken_rule(float(value), unit=unit)
        return (rule.code, rule.message(value)) if rule else None

    return fault


def _fps_fault(value: object) -> tuple[str, str] | None:
    if _is_number(value) and 0 < value < math.inf:
        return None
    return "bad-rate", f"fps is {kind_of(value)}; expected a rate in Hz, a finite number greater than 0."


def _gap_fault(value: object) -> tuple[str, str] | None:
    if _is_number(value) and value in range(1, N_FRAMES):
        return None
    return (
        "bad-rate",
        f"frame_gap is {kind_of(value)}; expected a whole number of frames from 1 to {N_FRAMES - 1}.",
    )


def _is_number(value: object) -> TypeGuard[int | float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


def require_once(names: list[str], findings: Findings, pointer_of: PointerOf) -> None:
    repeated = [name for name, count in Counter(names).items() if count > 1]
    if repeated:
        message = (
            f"{_n(len(repeated), 'key appears', 'keys appear')} more than once: "
            f"{listed([quoted(name) for name in repeated])}; expected every key once."
        )
        findings.group("duplicate-keys", message, pointer_of(repeated[0]), n_faults=len(repeated))


def _n(count: int, one: str, many: str) -> str:
    return f"{count:,} {one if count == 1 else many}"
