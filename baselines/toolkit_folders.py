"""The dataset as it is downloaded: `{bag_stamp}.pkl` with annotations, `{bag_stamp}/cam{n}/{ts}.jpg`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evaluator.truth.annotation_folders import list_files, read_annotations
from evaluator.truth.numbering import require_the_same
from evaluator.truth.truth import Manifest


def read_toolkit_folder(
    path: Path, *, manifest: Manifest | None = None
) -> tuple[Manifest, NDArray[np.float64]] | None:
    """The sequences and their boxes (n, 6, 4) in parts of the image; None for a folder without *.pkl.

    Sequences have the order and the anno_ids of `manifest` where one is given, else those of `tsttc
    manifest`. Raises `Rejected` for files at fault, and where folder and manifest have different sequences.
    """
    if not list_files(path):
        return None
    found = read_annotations(path, with_ttc=False, with_boxes=True)
    own = Manifest.from_table(found.table)
    boxes = np.array(found.boxes, dtype=np.float64).reshape(own.n_sequences, -1, 4)
    if manifest is None or manifest.digest == own.digest:
        return own, boxes
    require_the_same(own.natural_keys, manifest.natural_keys, path.name)
    rows = [own.row_of_natural_key[key] for key in manifest.natural_keys]
    return manifest, boxes[rows]
