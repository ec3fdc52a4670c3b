"""The ground truth of a split, and its public part, the manifest.

Both are read from CSV (`anno_id,bag_stamp,cam_id,ts,track_id,ttc`, ts in ns), from files written by `save`,
and from the toolkit's annotation folders.

Their digest is "sha256:" and the hex SHA-256 of a canonical text: the header, then a line per sequence in
ascending anno_id, fields separated by commas (`unit` before the time, if present), times as the shortest
decimal that reads back exactly, lines ended by a line feed.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evaluator.arguments import Source
from evaluator.metrics.protocol import TTCRange
from evaluator.metrics.scale import Floats, exact_log, scale_ratio_10hz
from evaluator.problems import Findings, quoted, reject
from evaluator.truth.annotation_folders import read_annotations
from evaluator.truth.csv_tables import UNIT, Table, load_store, read_csv, save_store
from evaluator.truth.objects import OBJECT_COLUMNS, Objects
from evaluator.units import Units, units_of

Integers = NDArray[np.int64]
KeyKind = Literal["anno_id", "natural_key"]


@dataclass(frozen=True, eq=False)
class Manifest:
    """The public description of a split's sequences, in file order. Arrays are `(n,)`, read-only.

    `unit` is empty unless the ground truth names a unit for every recording.
    """

    anno_id: Integers
    bag_stamp: tuple[str, ...]
    cam_id: tuple[str, ...]
    ts_ns: Integers
    track_id: tuple[str, ...]
    digest: str
    unit: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return (
            f"Manifest({self.n_sequences:,} sequences, {self.n_recordings:,} recordings, {self.digest[:19]}…)"
        )

    @classmethod
    def from_table(cls, table: Table) -> Manifest:
        """Check the rows; raises `Rejected` for none, duplicate ids or natural keys, and unclear units."""
        return cls._checked(table, table.digests()[0])

    @classmethod
    def _checked(cls, table: Table, digest: str) -> Manifest:
        if not table.anno_id:
            raise reject("empty", "There are no sequences; expected at least one.")
        anno_id, ts_ns = (np.array(column, dtype=np.int64) for column in (table.anno_id, table.ts_ns))
        anno_id.setflags(write=False)
        ts_ns.setflags(write=False)
        manifest = cls(
            anno_id=anno_id,
            bag_stamp=tuple(table.bag_stamp),
            cam_id=tuple(table.cam_id),
            ts_ns=ts_ns,
            track_id=tuple(table.track_id),
            digest=digest,
            unit=tuple(table.unit),
        )
        findings = Findings()
        if len(set(table.anno_id)) < len(table.anno_id):
            _find_duplicates(findings, "duplicate-ids", "anno_id", manifest.anno_id_keys, table)
        _find_duplicates(findings, "duplicate-natural-keys", "natural key", manifest.natural_keys, table)
        _find_two_units(findings, table)
        findings.raise_if_any()
        return manifest

    @property
    def n_sequences(self) -> int:
        """Number of sequences."""
        return len(self.anno_id)

    @cached_property
    def natural_keys(self) -> tuple[str, ...]:
        """`bag_stamp/cam_id/ts/track_id` of every target frame."""
        # A memory view gives one integer after the other, where a list would hold them all.
        columns = zip(self.bag_stamp, self.cam_id, map(str, self.ts_ns.data), self.track_id, strict=True)
        return tuple(map("/".join, columns))

    @cached_property
    def anno_id_keys(self) -> tuple[str, ...]:
        """The anno_ids as keys of a prediction file."""
        return tuple(map(str, self.anno_id.tolist()))

    def keys_of(self, kind: KeyKind = "natural_key") -> tuple[str, ...]:
        """The keys of a prediction file by row: natural keys, which mean the same in every edition."""
        return self.natural_keys if kind == "natural_key" else self.anno_id_keys

    @cached_property
    def rows_by_id(self) -> NDArray[np.intp] | slice:
        """The rows in ascending anno_id, as an index for arrays."""
        if (self.anno_id[1:] > self.anno_id[:-1]).all():
            return slice(None)
        return np.argsort(self.anno_id)

    @cached_property
    def row_of_id(self) -> dict[str, int]:
        """The row of every anno_id, by its decimal spelling."""
        return {key: row for row, key in enumerate(self.anno_id_keys)}

    @cached_property
    def row_of_natural_key(self) -> dict[str, int]:
        """The row of every natural key."""
        return {key: row for row, key in enumerate(self.natural_keys)}

    @cached_property
    def recordings(self) -> tuple[str, ...]:
        """The distinct bag_stamps, sorted."""
        return tuple(sorted(set(self.bag_stamp)))

    @cached_property
    def recording_index(self) -> Integers:
        """The index in `recordings` of every sequence."""
        index = {bag: i for i, bag in enumerate(self.recordings)}
        array = np.array([index[bag] for bag in self.bag_stamp], dtype=np.int64)
        array.setflags(write=False)
        return array

    @property
    def n_recordings(self) -> int:
        """Number of distinct bag_stamps."""
        return len(self.recordings)

    @cached_property
    def units(self) -> Units:
        """The units of `recordings`: column `unit`, else days, else recordings."""
        return self.units_by(None)

    def units_by(self, kind: str | None) -> Units:
        """Return the units of one kind, or by the rule; raises `ValueError` if the recordings lack them."""
        return units_of(
            self.recordings, given=dict(zip(self.bag_stamp, self.unit, strict=bool(self.unit))), kind=kind
        )

    def subset(self, rows: ArrayLike) -> Manifest:
        """Return some of the sequences, with their anno_ids: as `GroundTruth.subset`."""
        return Manifest.from_table(self.to_table().subset(self._chosen(rows)))

    def _chosen(self, rows: ArrayLike) -> list[int]:
        chosen: list[int] = np.arange(self.n_sequences)[np.asarray(rows)].tolist()
        return chosen

    def to_table(self) -> Table:
        """Return the columns as lists, without times to contact."""
        return Table(
            anno_id=self.anno_id.tolist(),
            bag_stamp=list(self.bag_stamp),
            cam_id=list(self.cam_id),
            ts_ns=self.ts_ns.tolist(),
            track_id=list(self.track_id),
            unit=list(self.unit),
        )

    def to_csv(self) -> bytes:
        """Write the public table: a header and a row per sequence in file order, UTF-8, line feeds."""
        table = self.to_table()
        return table.text(table.manifest_columns).encode()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an `.npz` that `load` reads back exactly."""
        save_store(path, columns=self._columns, manifest_digest=self.digest)

    @cached_property
    def _columns(self) -> dict[str, NDArray[Any]]:
        return {
            "anno_id": self.anno_id,
            "bag_stamp": np.array(self.bag_stamp, dtype=np.str_),
            "cam_id": np.array(self.cam_id, dtype=np.str_),
            "ts_ns": self.ts_ns,
            "track_id": np.array(self.track_id, dtype=np.str_),
            **({UNIT: np.array(self.unit, dtype=np.str_)} if self.unit else {}),
        }

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Manifest:
        """Read what `save` wrote, also of a `GroundTruth`; raises `Rejected` for damage or another digest."""
        table, digest, _ = load_store(path, with_ttc=False)
        manifest = cls.from_table(table)
        _check_digest(stored=digest, actual=manifest.digest, path=path)
        return manifest


@dataclass(frozen=True, eq=False)
class GroundTruth:
    """One revision of the hidden values: the manifest, and τ in seconds, a read-only array `(n,)`.

    `objects` are further annotations, outside of the digest and of `save`.
    """

    manifest: Manifest
    ttc_s: Floats
    digest: str
    objects: Objects = field(default_factory=Objects)

    def __repr__(self) -> str:
        ends = f"{self.ttc_s.min():.4g} to {self.ttc_s.max():.4g} s"
        return f"GroundTruth({self.n_sequences:,} sequences, {ends}, {self.digest[:19]}…)"

    @classmethod
    def from_table(cls, table: Table) -> GroundTruth:
        """Check rows and values; raises `Rejected` that names the rows at fault."""
        manifest_digest, digest = table.digests()
        manifest = Manifest._checked(table, manifest_digest)
        ttc_s = np.array(table.ttc_s, dtype=np.float64)
        _check_values(ttc_s, table)
        ttc_s.setflags(write=False)
        objects = Objects.of(occ_ratio=table.occ_ratio, same_lane=table.same_lane, box2d=table.box2d)
        return cls(manifest=manifest, ttc_s=ttc_s, digest=digest, objects=objects)

    @property
    def n_sequences(self) -> int:
        """Number of sequences."""
        return self.manifest.n_sequences

    @cached_property
    def ascending_rows(self) -> NDArray[np.intp]:
        """The rows in ascending τ; equal values in file order."""
        return np.argsort(self.ttc_s, kind="stable")

    @cached_property
    def ascending_ttc_s(self) -> Floats:
        """τ in ascending order."""
        return self.ttc_s[self.ascending_rows]

    @cached_property
    def ascending_log_scale_ratio(self) -> Floats:
        """ln α₁₀(τ) in ascending τ, the truth's part of every MiD."""
        return exact_log(scale_ratio_10hz(self.ascending_ttc_s))

    def counts_of(self, ranges: Iterable[TTCRange]) -> dict[str, int]:
        """Count the sequences of each TTC range by name; a shared end counts twice."""
        return {each.name: int(np.count_nonzero(each.contains(self.ttc_s))) for each in ranges}

    def n_outside(self, ranges: Iterable[TTCRange]) -> int:
        """Count the sequences outside of these TTC ranges."""
        inside = [each.contains(self.ttc_s) for each in ranges]
        return self.n_sequences - int(np.count_nonzero(np.logical_or.reduce(inside)))

    def subset(self, rows: ArrayLike) -> GroundTruth:
        """Return some sequences, such as a fold: `rows` is a mask `(n,)` of bools, or rows in any order.

        They keep their anno_ids; predictions of the whole are scored as `predictions.subset(rows)`. Raises
        `IndexError` for rows that are not there, `Rejected` for none and for a row that comes twice.
        """
        return GroundTruth.from_table(self.to_table().subset(self.manifest._chosen(rows)))

    def to_table(self) -> Table:
        """Return the columns as lists."""
        table = self.manifest.to_table()
        table.ttc_s = self.ttc_s.tolist()
        table.occ_ratio, table.same_lane, table.box2d = self.objects.to_columns()
        return table

    def to_csv(self) -> bytes:
        """Write the whole table with τ and objects in file order, for `read_truth`."""
        table = self.to_table()
        known = tuple(name for name in OBJECT_COLUMNS if getattr(table, name))
        return table.text((*table.manifest_columns, "ttc", *known)).encode()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an `.npz` that `load` reads back exactly."""
        columns = {**self.manifest._columns, "ttc_s": self.ttc_s}
        save_store(path, columns=columns, manifest_digest=self.manifest.digest, truth_digest=self.digest)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> GroundTruth:
        """Read what `save` wrote; raises `Rejected` for damage or another digest."""
        table, _, digest = load_store(path, with_ttc=True)
        truth = cls.from_table(table)
        _check_digest(stored=digest, actual=truth.digest, path=path)
        return truth


def read_truth(source: Source) -> GroundTruth:
    """Read ground truth from CSV, a saved `.npz`, or a folder of the toolkit's `*.pkl` annotations.

    `source` is a path, the bytes of a CSV file, or an open file; row order is kept. Raises `Rejected` for
    duplicate ids or natural keys, malformed fields, non-finite τ and −0.1 ≤ τ ≤ 0, where MiD is undefined.
    """
    if _is_store(source):
        return GroundTruth.load(source)
    return GroundTruth.from_table(_table_of(source, with_ttc=True))


def read_manifest(source: Source) -> Manifest:
    """Read a manifest from any source of `read_truth`; true times may be absent and are ignored."""
    if _is_store(source):
        return Manifest.load(source)
    return Manifest.from_table(_table_of(source, with_ttc=False))


def _is_store(source: Source) -> TypeGuard[str | os.PathLike[str]]:
    return isinstance(source, str | os.PathLike) and Path(source).suffix == ".npz" and Path(source).is_file()


def _table_of(source: Source, *, with_ttc: bool) -> Table:
    if isinstance(source, str | os.PathLike) and Path(source).is_dir():
        return read_annotations(Path(source), with_ttc=with_ttc).table
    return read_csv(source, with_ttc=with_ttc)


def _check_values(ttc_s: Floats, table: Table) -> None:
    findings = Findings()
    finite = np.isfinite(ttc_s)
    for row in np.flatnonzero(~finite).tolist():
        findings.add("truth-not-finite", f"ttc is {ttc_s[row]}; expected a finite number.", table.where(row))
    alpha = scale_ratio_10hz(ttc_s)
    # The last two conditions only keep the arithmetic finite; no real value comes near them.
    near = (ttc_s >= -0.1) & (ttc_s <= 0.0)
    undefined = near | ~(np.isfinite(alpha) & (alpha > 0)) | (np.abs(ttc_s) < 1e-200)
    for row in np.flatnonzero(finite & undefined).tolist():
        message = (
            f"ttc is {ttc_s[row]!s}, where the errors are undefined; expected ttc >= 1e-200 or ttc < -0.1."
        )
        findings.add("truth-near-zero", message, table.where(row))
    findings.raise_if_any()


def _find_duplicates(findings: Findings, code: str, noun: str, keys: Sequence[str], table: Table) -> None:
    if len(set(keys)) == len(keys):
        return
    first: dict[str, int] = {}
    for row, key in enumerate(keys):
        earlier = first.setdefault(key, row)
        if earlier != row:
            message = f"The {noun} {quoted(key)} is already used at {table.where(earlier)}; expected it once."
            findings.add(code, message, table.where(row))


def _find_two_units(findings: Findings, table: Table) -> None:
    # Sequences of one recording are dependent, so a recording has one unit.
    first: dict[str, int] = {}
    for row, (recording, unit) in enumerate(zip(table.bag_stamp, table.unit, strict=bool(table.unit))):
        earlier = first.setdefault(recording, row)
        if table.unit[earlier] != unit:
            message = (
                f"The recording {quoted(recording)} has the unit {quoted(unit)} here and "
                f"{quoted(table.unit[earlier])} at {table.where(earlier)}; expected one unit for a recording."
            )
            findings.add("two-units", message, table.where(row))


def _check_digest(*, stored: str, actual: str, path: str | os.PathLike[str]) -> None:
    if stored != actual:
        message = f"The content has the digest {actual}; expected {quoted(stored)}, which is stored with it."
        raise reject("bad-digest", message, Path(path).name)
