"""A submission's values in the order of an edition's ground truth: saved, or read from the file.

A file is read with the manifest of its time; natural keys map its values to the edition's manifest, so only a
correction that adds sequences needs another file.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import structlog
from django.conf import settings
from numpy.typing import NDArray

from evaluator import Predictions
from evaluator.predictions.revisions import Rows, absent, realigned, rows_in
from leaderboard.models import Edition, SentFile
from leaderboard.sandbox import child
from leaderboard.storage import files, manifests, truth_values

log = structlog.get_logger(__name__)


def saved(file: SentFile, edition: Edition) -> Predictions | None:
    """Return the saved values, if they are complete.

    Raises `evaluator.Rejected` if the edition has further sequences, and `OSError` if directory or store do
    not answer.
    """
    manifest = truth_values.load(edition.ground_truth_id).manifest
    n_sent, order, missing = _sent_order(file.manifest_digest, edition.ground_truth_id)
    if len(missing):
        raise absent(missing, manifest=manifest)
    ascending = files.load_aligned(file, n_sequences=n_sent)
    if ascending is None:
        return None
    ttc_s = ascending if order is None else ascending[order]
    return Predictions(manifest=manifest, ttc_s=ttc_s, digest=file.digest)


@lru_cache(maxsize=16)
def _sent_order(own_digest: str, truth_digest: str) -> tuple[int, Rows | None, Rows]:
    """Return the length of a file for this manifest, and the index of each value, (n,) in truth order.

    None is the same order. The third are the rows of the truth that the manifest lacks.
    """
    manifest = truth_values.load(truth_digest).manifest
    own = manifest if manifest.digest == own_digest else manifests.load(own_digest)
    rows = rows_in(own, manifest)
    index_of_row: NDArray[np.intp] = np.empty(own.n_sequences, dtype=np.intp)
    index_of_row[own.rows_by_id] = np.arange(own.n_sequences)
    order = index_of_row[rows]
    is_same_order = own.n_sequences == len(order) and bool(np.array_equal(order, np.arange(len(order))))
    return own.n_sequences, None if is_same_order else order, np.flatnonzero(rows < 0)


def read(file: SentFile, edition: Edition, *, heartbeat: Callable[[], bool] = lambda: True) -> Predictions:
    """Read the values from the file, and save them.

    Raises `evaluator.Rejected`, `OSError` if store, disk or private directory do not answer, and what
    `child.read_predictions` raises.
    """
    manifest = truth_values.load(edition.ground_truth_id).manifest
    is_own = manifest.digest == file.manifest_digest
    own = manifest if is_own else manifests.load(file.manifest_digest)
    with files.opened_predictions(file.digest) as source:
        predictions = child.read_predictions(
            source,
            digest=file.digest,
            manifest=own,
            manifest_path=(
                truth_values.manifest_path(edition.ground_truth_id)
                if is_own
                else manifests.path(file.manifest_digest)
            ),
            heartbeat=heartbeat,
            heartbeat_s=settings.HEARTBEAT_S,
        )
    try:
        files.save_aligned(predictions)
    except OSError as fault:
        # They only make re-scoring quicker; without them it reads the file again.
        log.warning("values_not_kept", digest=file.digest, reason=f"{type(fault).__name__}: {fault}")
    return predictions if is_own else realigned(predictions, manifest=manifest)


def load(file: SentFile, edition: Edition) -> Predictions:
    """Return the saved values, or read the file. Raises as `read` does."""
    return saved(file, edition) or read(file, edition)
