"""Prediction files: bytes in, values aligned with a manifest out, or a `Rejected` that says why.

The format is described in docs/file-format.md. Nothing but `Rejected` leaves `read_predictions`, whatever
the bytes; every sequence of the manifest ends up with exactly one finite or infinite value that is neither 0
nor NaN.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from evaluator.metrics.scale import Floats
from evaluator.predictions.alignment import KeyKind, read_slowly
from evaluator.predictions.columns import read_column
from evaluator.predictions.documents import Unit
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

    @classmethod
    def from_arrays(
        cls,
        *,
        ttc_s: ArrayLike,
        manifest: Manifest,
        digest: str | None = None,
        unit: Unit = "ttc",
        meta: Mapping[str, object] | None = None,
    ) -> Predictions:
        """Predictions from seconds in the manifest's order, without a file.

        Without a `digest`, that of the values' little-endian float64 bytes is taken. Raises `ValueError` for
        another shape than (n,); forbidden values are found by `evaluate`.
        """
        values = np.array(ttc_s, dtype=np.float64)
        if values.shape != (manifest.n_sequences,):
            raise ValueError(f"ttc_s has the shape {values.shape}; expected ({manifest.n_sequences},).")
        values.setflags(write=False)
        found = digest if digest is not None else sha256_digest(values.astype("<f8").tobytes())
        return cls(manifest=manifest, ttc_s=values, digest=found, unit=unit, meta=meta)

    def where(self, row: int) -> str:
        """The JSON pointer to the value of sequence `row`."""
        ours = self.manifest.anno_id_keys if self.keys == "anno_id" else self.manifest.natural_keys
        names = ours if self.names is None else self.names
        return pointer("predictions", names[row]) if self.enveloped else pointer(names[row])


def read_predictions(data: bytes, *, manifest: Manifest, max_bytes: int | None = None) -> Predictions:
    """Read a prediction file and align it with `manifest`; raises `Rejected` with every fault of the file.

    `data` is the whole file in either form of docs/file-format.md; larger than `max_bytes` it is not looked
    at.
    """
    if max_bytes is not None and len(data) > max_bytes:
        raise reject("too-large", f"The file has {len(data):,} bytes; expected at most {max_bytes:,}.")
    found = read_column(data, manifest) or read_slowly(data, manifest)
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
