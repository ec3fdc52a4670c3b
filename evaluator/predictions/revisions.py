"""Revisions of a ground truth: their differences by natural key, and a file for one read with another."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evaluator.counting import counted
from evaluator.predictions.loading import Predictions
from evaluator.problems import Problem, Rejected, listed, pointer, quoted
from evaluator.truth.ground_truth import GroundTruth, Manifest

Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Comparison:
    """Counts of sequences: added, removed, with another time to contact, with another anno_id."""

    n_added: int
    n_removed: int
    n_changed: int
    n_renumbered: int


def compare(old: GroundTruth, new: GroundTruth) -> Comparison:
    rows = rows_in(old.manifest, new.manifest)
    common = rows >= 0
    n_common = int(np.count_nonzero(common))
    before = rows[common]
    return Comparison(
        n_added=new.n_sequences - n_common,
        n_removed=old.n_sequences - n_common,
        n_changed=int(np.count_nonzero(old.ttc_s[before] != new.ttc_s[common])),
        n_renumbered=int(np.count_nonzero(old.manifest.anno_id[before] != new.manifest.anno_id[common])),
    )


def rows_in(old: Manifest, new: Manifest) -> Rows:
    """Find the row in `old` of every sequence of `new`, (n,); -1 if absent."""
    if old.digest == new.digest:
        # The same sequences under the same numbers, whose rows may stand in another order.
        rows = np.empty(new.n_sequences, dtype=np.intp)
        rows[new.rows_by_id] = np.arange(old.n_sequences)[old.rows_by_id]
        return rows
    row_of = old.row_of_natural_key
    return np.array([row_of.get(key, -1) for key in new.natural_keys], dtype=np.intp)


def realigned(predictions: Predictions, *, manifest: Manifest) -> Predictions:
    """Reorder predictions for another manifest; raises `Rejected` (`missing-keys`) for new sequences."""
    own = predictions.manifest
    rows = rows_in(own, manifest)
    if len(missing := np.flatnonzero(rows < 0)):
        raise absent(missing, manifest=manifest)
    ttc_s = predictions.ttc_s[rows]
    ttc_s.setflags(write=False)
    names = own.keys_of(predictions.keys)
    sent = tuple([names[row] for row in rows.tolist()])
    return replace(predictions, manifest=manifest, ttc_s=ttc_s, names=sent)


def absent(rows: Rows, *, manifest: Manifest) -> Rejected:
    """Make the rejection for these rows of `manifest`, which the file's own manifest lacks."""
    names = [manifest.natural_keys[row] for row in rows.tolist()]
    n = len(names)
    what = counted(n, "sequence has", "sequences have")
    message = (
        f"{what} no value, added by a correction after the file was sent: "
        f"{listed([quoted(name) for name in names])}; expected a new file with one for each of the "
        f"{manifest.n_sequences:,} sequences of the present manifest."
    )
    return Rejected([Problem("missing-keys", message, pointer(names[0]))], n_problems=n)
