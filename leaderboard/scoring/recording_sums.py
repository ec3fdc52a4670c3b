"""Sums per recording, kept where only workers look: in the private directory, beside the ground truth.

They are made when a file is scored, and are all that intervals, rank ranges and comparisons need. Each file
is named by what it was made of, so it never changes; whatever is missing, as on another worker, is made anew
from the submission's values.
"""

import os
import tempfile
from functools import lru_cache
from pathlib import Path

import numpy as np
import structlog
from django.conf import settings
from numpy.typing import NDArray

from evaluator import GroundTruth, floors, published
from evaluator.protocol import SCORE_NAMES, get_protocol
from evaluator.report import BagSums
from evaluator.scoring import Scorer
from leaderboard import aligned, ground_truth
from leaderboard.models import Edition, SentFile

log = structlog.get_logger(__name__)

Floats = NDArray[np.float64]


def path(edition: Edition, *, file: SentFile) -> Path:
    """Where the sums of a file are kept for this ground truth and protocol."""
    truth = edition.ground_truth_id.removeprefix("sha256:")
    kept = Path(settings.BAGS_DIR or Path(settings.GROUND_TRUTH_DIR) / "bags")
    digest, manifest = (part.removeprefix("sha256:") for part in file)
    return kept / f"{truth[:32]}-{edition.protocol}" / f"{digest}-{manifest[:32]}.f8"


def keep(edition: Edition, *, file: SentFile, bags: BagSums | None) -> None:
    """Keep a file's sums, little-endian float64. A disk that does not take them costs only time later."""
    if bags is None:
        return
    target = path(edition, file=file)
    try:
        target.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        handle, temporary = tempfile.mkstemp(dir=target.parent)
        with os.fdopen(handle, "wb") as out:
            out.write(bags.sums.astype("<f8").tobytes())
        Path(temporary).replace(target)
    except OSError as fault:
        log.warning("bags_not_kept", digest=file.digest, reason=str(fault)[:200])


def load(edition: Edition, *, file: SentFile) -> Floats | None:
    """The sums that were kept, (G, 10); None if they are not all there."""
    n_bags = edition.ground_truth.n_recordings
    try:
        data = path(edition, file=file).read_bytes()
    except OSError:
        return None
    if len(data) != n_bags * len(SCORE_NAMES) * 8:
        return None
    return np.frombuffer(data, dtype="<f8").reshape(n_bags, len(SCORE_NAMES)).astype(np.float64)


def sums_of(edition: Edition, *, file: SentFile) -> Floats:
    """The sums of a scored file, kept or made anew, (G, 10).

    Raises what `aligned.read` raises.
    """
    kept = load(edition, file=file)
    if kept is not None:
        return kept
    predictions = aligned.of(file, edition)
    bags = _scorer(edition.ground_truth_id, edition.protocol).report(predictions, keep_bags=True).bags
    assert bags is not None  # noqa: S101 - they were asked for
    keep(edition, file=file, bags=bags)
    return bags.sums


def counts_of(edition: Edition) -> Floats:
    """Sequences per recording in every column, (G, 10). Raises `OSError` without access to the values."""
    return _scorer(edition.ground_truth_id, edition.protocol).bag_counts


def floor_of(edition: Edition) -> dict[str, float | None]:
    """What the ground truth itself scores, as it is published. Raises `OSError` without access to it."""
    floor = floors.floor_of(ground_truth.load(edition.ground_truth_id), protocol=edition.protocol)
    return {name: published(value, decimals=edition.decimals) for name, value in floor.items()}


@lru_cache(maxsize=2)
def _scorer(truth_digest: str, protocol: str) -> Scorer:
    truth: GroundTruth = ground_truth.load(truth_digest)
    return Scorer(truth, get_protocol(protocol))
