"""Sums per recording, saved in the private directory of workers when a file is scored.

Intervals, rank ranges and comparisons need nothing else. Missing sums, as on another worker, are computed
again.
"""

import math
import uuid
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np
import structlog
from django.conf import settings
from numpy.typing import NDArray

from evaluator import GroundTruth, Rejected, rounded
from evaluator.metrics.protocol import get_protocol
from evaluator.scoring import scores, uncertainty
from evaluator.scoring.results import RecordingSums
from evaluator.scoring.scores import Scorer
from evaluator.units import Units
from leaderboard.models import Edition, SentFile
from leaderboard.sandbox import child, file_values
from leaderboard.storage import truth_values

log = structlog.get_logger(__name__)

Floats = NDArray[np.float64]
FAULTS: Final = (OSError, Rejected, child.ChildDied, child.ChildNotReady, child.LeaseLost)
"""What is raised where the values of a scored file cannot be read at present."""


def path(edition: Edition, *, file: SentFile) -> Path:
    """Return the path of a file's sums for this ground truth and protocol."""
    truth, digest, manifest = (
        each.removeprefix("sha256:") for each in (edition.ground_truth_id, file.digest, file.manifest_digest)
    )
    kept = Path(settings.BAGS_DIR or f"{settings.GROUND_TRUTH_DIR}/bags")
    return kept / f"{truth[:32]}-{edition.protocol}" / f"{digest}-{manifest[:32]}.f8"


def save(edition: Edition, *, file: SentFile, bags: RecordingSums | None) -> None:
    # Without the sums on the disk they are computed again.
    if bags is None:
        return
    kept = path(edition, file=file)
    temporary = kept.with_name(f"tmp{uuid.uuid4().hex}")
    try:
        kept.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        temporary.touch(mode=0o600, exist_ok=False)
        temporary.write_bytes(np.ascontiguousarray(bags.sums, dtype="<f8").data)
        temporary.replace(kept)
    except OSError as fault:
        log.warning("bags_not_kept", digest=file.digest, reason=str(fault)[:200])


def load(edition: Edition, *, file: SentFile) -> Floats | None:
    """Load the sums, (G, columns), if they are complete."""
    shape = edition.ground_truth.n_recordings, len(edition.rules.score_names)
    try:
        data = path(edition, file=file).read_bytes()
    except OSError:
        return None
    if len(data) != math.prod(shape) * 8:
        return None
    return np.frombuffer(data, dtype="<f8").reshape(shape).astype(np.float64)


def sums_of(edition: Edition, *, file: SentFile) -> Floats:
    """Load or compute the sums of a scored file, (G, columns). Raises what `file_values.read` raises."""
    kept = load(edition, file=file)
    if kept is not None:
        return kept
    predictions = file_values.load(file, edition)
    bags = scorer(edition.ground_truth_id, edition.protocol).report(predictions, keep_bags=True).bags
    assert bags is not None  # noqa: S101 - they were asked for
    save(edition, file=file, bags=bags)
    return bags.sums


def counts_of(edition: Edition) -> Floats:
    """Count sequences per recording in every column, (G, columns). Raises `OSError` without the values."""
    return scorer(edition.ground_truth_id, edition.protocol).recording_counts


def unit_sums_of(edition: Edition, *, file: SentFile) -> Floats:
    """Add the sums up to the edition's units, (U, columns)."""
    return uncertainty.by_units(sums_of(edition, file=file), units_of(edition))


def unit_counts_of(edition: Edition) -> Floats:
    """Count the sequences per unit in every column, (U, columns). Raises `OSError` as `counts_of`."""
    return uncertainty.by_units(counts_of(edition), units_of(edition))


def units_of(edition: Edition) -> Units:
    """Return the edition's units. Raises `OSError` without the values of its ground truth."""
    return _units(edition.ground_truth_id, edition.unit)


@lru_cache(maxsize=4)
def _units(truth_digest: str, kind: str) -> Units:
    return truth_values.load(truth_digest).manifest.units_by(kind)


def floor_of(edition: Edition) -> dict[str, float | None]:
    """Return the score of the ground truth itself. Raises `OSError` without access to it."""
    floor = scores.floor_of(
        truth_values.load(edition.ground_truth_id), protocol=get_protocol(edition.protocol)
    )
    return {name: rounded(value, decimals=edition.decimals) for name, value in floor.items()}


def scorer(truth_digest: str, protocol: str) -> Scorer:
    """Make the scorer of an edition with the cached truth. Raises as `truth_values.load`."""
    truth: GroundTruth = truth_values.load(truth_digest)
    return _scorer(truth, protocol)


@lru_cache(maxsize=2)
def _scorer(truth: GroundTruth, protocol: str) -> Scorer:
    return Scorer(truth, get_protocol(protocol))
