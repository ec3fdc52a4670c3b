"""Prediction files: bytes in, values aligned with a manifest out, or a `Rejected` that says why.

The format is described in docs/file-format.md. Nothing but `Rejected` leaves `read_sent`, whatever
the bytes; every sequence of the manifest ends up with exactly one finite or infinite value that is neither 0
nor NaN.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from evaluator.arguments import Source, data_of, require
from evaluator.metrics.scale import Floats, scale_ratio_to_ttc
from evaluator.predictions.alignment import KeyKind, read_slowly
from evaluator.predictions.columns import read_column
from evaluator.predictions.documents import Unit
from evaluator.predictions.packages import json_of
from evaluator.predictions.parquet import as_sent
from evaluator.predictions.writing import rate_of, require_values
from evaluator.problems import pointer, reject
from evaluator.truth.truth import Manifest


@dataclass(frozen=True, slots=True, eq=False)
class Predictions:
    """One value per sequence of the manifest.

    `ttc_s` is float64 (n,), read-only, in the manifest's order: seconds from the target frame, scale ratios
    already converted, nothing truncated. `digest` is "sha256:" and the hex SHA-256 of the file's bytes.
    `names` are the file's own keys by row, where it was written for another manifest than this one.
    """

    manifest: Manifest
    ttc_s: Floats
    digest: str
    unit: Unit = "ttc"
    meta: Mapping[str, object] | None = None
    keys: KeyKind = "anno_id"
    enveloped: bool = False
    names: tuple[str, ...] | None = None

    def __repr__(self) -> str:
        ends = f"{self.ttc_s.min():.4g} to {self.ttc_s.max():.4g} s"
        return f"Predictions({len(self.ttc_s):,} sequences, {ends}, {self.digest[:19]}…)"

    @classmethod
    def from_arrays(
        cls,
        *,
        manifest: Manifest,
        ttc_s: ArrayLike | None = None,
        scale_ratio: ArrayLike | None = None,
        fps_hz: float | None = None,
        frame_gap: int | None = None,
        digest: str | None = None,
        unit: Unit = "ttc",
        meta: Mapping[str, object] | None = None,
    ) -> Predictions:
        """Predictions from values in the manifest's order, without a file.

        Give either `ttc_s` (seconds) or `scale_ratio` with `fps_hz` or `frame_gap`, (n,). Without a `digest`,
        that of the seconds' little-endian float64 bytes is taken. Raises `ValueError` for another shape and
        for arguments that do not fit together, `Rejected` for scale ratios that are not greater than 0; other
        forbidden values are found by `evaluate`.
        """
        require(manifest, Manifest, name="manifest")
        name, given = ("scale_ratio", scale_ratio) if ttc_s is None else ("ttc_s", ttc_s)
        if given is None or (ttc_s is not None and scale_ratio is not None):
            raise ValueError("Give either ttc_s or scale_ratio.")
        values = np.array(given, dtype=np.float64)
        if values.shape != (manifest.n_sequences,):
            raise ValueError(f"{name} has the shape {values.shape}; expected ({manifest.n_sequences},).")
        rate_hz = rate_of(is_ratio=ttc_s is None, fps_hz=fps_hz, frame_gap=frame_gap)
        if rate_hz is not None:
            require_values(values, manifest.anno_id_keys, is_ratio=True)
            values, unit = scale_ratio_to_ttc(values, fps_hz=rate_hz), "scale_ratio"
        values.setflags(write=False)
        found = digest if digest is not None else sha256_digest(values.astype("<f8").tobytes())
        return cls(manifest=manifest, ttc_s=values, digest=found, unit=unit, meta=meta)

    def where(self, row: int) -> str:
        """The JSON pointer to the value of sequence `row`."""
        ours = self.manifest.anno_id_keys if self.keys == "anno_id" else self.manifest.natural_keys
        names = ours if self.names is None else self.names
        return pointer("predictions", names[row]) if self.enveloped else pointer(names[row])


def read_predictions(source: Source, *, manifest: Manifest, max_bytes: int | None = None) -> Predictions:
    """Read a prediction file and align it with `manifest`; raises `Rejected` with every fault of the file.

    `source` is a path, the bytes of the file or the file itself, open, in any form of docs/file-format.md;
    larger than `max_bytes` it is not looked at. The digest is that of the bytes, of a Parquet table that of
    the JSON that is sent in its place; such a table needs pyarrow (`ModuleNotFoundError` without).
    """
    require(manifest, Manifest, name="manifest")
    data = data_of(source)
    if max_bytes is not None and len(data) > max_bytes:
        raise reject("too-large", f"The file has {len(data):,} bytes; expected at most {max_bytes:,}.")
    return read_sent(as_sent(data), manifest=manifest)


def read_sent(data: bytes, *, manifest: Manifest) -> Predictions:
    """As `read_predictions`, in the forms that a leaderboard takes: bytes of strangers come here."""
    text = json_of(data, max_rows=2 * manifest.n_sequences + 100_000)
    found = read_column(text, manifest) or read_slowly(text, manifest)
    found.ttc_s.setflags(write=False)
    return Predictions(
        manifest=manifest,
        ttc_s=found.ttc_s,
        digest=sha256_digest(data),
        unit=found.document.unit,
        meta=found.document.meta,
        keys=found.keys,
        enveloped=found.document.enveloped,
    )


def sha256_digest(data: bytes) -> str:
    """`sha256:` and the hex digest of `data`."""
    return "sha256:" + hashlib.sha256(data).hexdigest()
