"""The toolkit's anno_ids on this machine, compared with a manifest's."""

# The toolkit counts over files in the file system's order, a manifest over sorted files; within a file both
# agree.

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evaluator.metrics.scale import Floats
from evaluator.problems import Findings, listed
from evaluator.truth.annotation_folders import read_annotations
from evaluator.truth.ground_truth import Manifest


@dataclass(frozen=True, eq=False)
class Numbering:
    """A manifest, and `rows`: for each anno_id of the toolkit, from 0 up, the row of the manifest."""

    manifest: Manifest
    rows: NDArray[np.intp]

    @property
    def n_renumbered(self) -> int:
        """The number of anno_ids that name different sequences in toolkit and manifest."""
        return int(np.count_nonzero(self.manifest.anno_id[self.rows] != np.arange(len(self.rows))))

    @cached_property
    def natural_keys(self) -> dict[str, str]:
        """The natural key of each anno_id of the toolkit."""
        keys = self.manifest.natural_keys
        return {str(anno_id): keys[row] for anno_id, row in enumerate(self.rows.tolist())}

    def realigned(self, ttc_s: Floats) -> Floats:
        """Reorder values that were read by the manifest's anno_ids, but are numbered by the toolkit's."""
        values = np.empty_like(ttc_s)
        values[self.rows] = ttc_s[np.argsort(self.manifest.anno_id, kind="stable")]
        return values


def read_numbering(folder: str | Path, *, manifest: Manifest | None = None) -> Numbering:
    """Read how the toolkit numbers an annotation folder on this machine, compared with `manifest`.

    Without `manifest`, one is made from the folder. Raises `Rejected` for an unreadable folder or different
    sequences.
    """
    folder = Path(folder)
    annotated = read_annotations(folder, with_ttc=False)
    own = Manifest.from_table(annotated.table)
    ends = np.cumsum(annotated.n_sequences)
    rows = np.concatenate(
        [np.arange(ends[file] - annotated.n_sequences[file], ends[file]) for file in annotated.listed]
    ).astype(np.intp)
    if manifest is None or manifest.digest == own.digest:
        return Numbering(own, rows)
    require_the_same(own.natural_keys, manifest.natural_keys, folder.name)
    keys, row_of = own.natural_keys, manifest.row_of_natural_key
    return Numbering(manifest, np.array([row_of[keys[row]] for row in rows.tolist()], dtype=np.intp))


def require_the_same(own: Sequence[str], wanted: Sequence[str], where: str) -> None:
    """Raise `Rejected` if the natural keys of folder and manifest differ."""
    findings = Findings()
    for code, missing, words in (
        ("missing-keys", sorted(set(wanted) - set(own)), "The folder lacks sequences of the manifest ({})"),
        (
            "unknown-keys",
            sorted(set(own) - set(wanted)),
            "The folder has sequences that the manifest lacks ({})",
        ),
    ):
        if missing:
            message = f"{words.format(f'{len(missing):,}')}: {listed(missing)}; expected the same sequences."
            findings.group(code, message, where, n_faults=len(missing))
    findings.raise_if_any()
