"""Sums per recording, saved in the private directory of workers, beside the ground truth.

They are made when a file is scored, and are all that intervals, rank ranges and comparisons need. Each file
is named by what it was made of, so it never changes; whatever is missing, as on another worker, is made anew
from the submission's values. What is inferred is inferred from the sums of an edition's units, which are days
or recordings: whole recordings added up.
"""

import math
import os
import uuid
from functools import lru_cache
from pathlib import Path

import numpy as np
import structlog
from django.conf import settings
from numpy.typing import NDArray

from evaluator import GroundTruth, published
from evaluator.metrics.protocol import get_protocol
from evaluator.scoring import scoring, uncertainty
from evaluator.scoring.report import RecordingSums
from evaluator.scoring.scoring import Scorer
from evaluator.units import Units
from leaderboard.models import Edition, SentFile
from leaderboard.scoring import sandbox
from leaderboard.storage import truth_values

log = structlog.get_logger(__name__)

Floats = NDArray[np.float64]
_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL


def path(edition: Edition, *, file: SentFile) -> Path:
    """Where the sums of a file are kept for this ground truth and protocol."""
    return Path(_folder(edition), _name(file))


def _folder(edition: Edition) -> str:
    truth = edition.ground_truth_id.removeprefix("sha256:")
    kept = settings.BAGS_DIR or f"{settings.GROUND_TRUTH_DIR}/bags"
    return f"{kept}/{truth[:32]}-{edition.protocol}"


def _name(file: SentFile) -> str:
    digest, manifest = (part.removeprefix("sha256:") for part in file)
    return f"{digest}-{manifest[:32]}.f8"


def save(edition: Edition, *, file: SentFile, bags: RecordingSums | None) -> None:
    """Keep a file's sums, little-endian float64. A disk that does not take them costs only time later."""
    if bags is None:
        return
    # Once for each file of a re-scoring: paths as objects would take longer than the writing.
    folder = _folder(edition)
    temporary = f"{folder}/tmp{uuid.uuid4().hex}"  # noqa: S108 - a folder of our own
    try:
        try:
            handle = os.open(temporary, _NEW, 0o600)
        except FileNotFoundError:
            Path(folder).mkdir(parents=True, exist_ok=True, mode=0o700)
            handle = os.open(temporary, _NEW, 0o600)
        with os.fdopen(handle, "wb") as out:
            out.write(np.ascontiguousarray(bags.sums, dtype="<f8").data)
        os.replace(temporary, f"{folder}/{_name(file)}")  # noqa: PTH105 - see above
    except OSError as fault:
        log.warning("bags_not_kept", digest=file.digest, reason=str(fault)[:200])


def load(edition: Edition, *, file: SentFile) -> Floats | None:
    """The sums that were kept, (G, columns); None if they are not all there."""
    shape = edition.ground_truth.n_recordings, len(edition.rules.score_names)
    try:
        data = path(edition, file=file).read_bytes()
    except OSError:
        return None
    if len(data) != math.prod(shape) * 8:
        return None
    return np.frombuffer(data, dtype="<f8").reshape(shape).astype(np.float64)


def sums_of(edition: Edition, *, file: SentFile) -> Floats:
    """The sums of a scored file, kept or made anew, (G, columns).

    Raises what `sandbox.read` raises.
    """
    kept = load(edition, file=file)
    if kept is not None:
        return kept
    predictions = sandbox.of(file, edition)
    bags = scorer(edition.ground_truth_id, edition.protocol).report(predictions, keep_bags=True).bags
    assert bags is not None  # noqa: S101 - they were asked for
    save(edition, file=file, bags=bags)
    return bags.sums


def counts_of(edition: Edition) -> Floats:
    """Sequences per recording in every column, (G, columns). Raises `OSError` without the values."""
    return scorer(edition.ground_truth_id, edition.protocol).recording_counts


def unit_sums_of(edition: Edition, *, file: SentFile) -> Floats:
    """The same added up to the edition's units, (U, columns)."""
    return uncertainty.by_units(sums_of(edition, file=file), units_of(edition))


def unit_counts_of(edition: Edition) -> Floats:
    """Sequences per unit of the edition in every column, (U, columns). Raises `OSError` as `counts_of`."""
    return uncertainty.by_units(counts_of(edition), units_of(edition))


def units_of(edition: Edition) -> Units:
    """The units that the edition keeps. Raises `OSError` without the values of its ground truth."""
    return _units(edition.ground_truth_id, edition.unit)


@lru_cache(maxsize=4)
def _units(truth_digest: str, kind: str) -> Units:
    return truth_values.load(truth_digest).manifest.units_by(kind)


def floor_of(edition: Edition) -> dict[str, float | None]:
    """What the ground truth itself scores, as it is published. Raises `OSError` without access to it."""
    floor = _floor(edition.ground_truth_id, edition.protocol)
    return {name: published(value, decimals=edition.decimals) for name, value in floor.items()}


@lru_cache(maxsize=4)
def _floor(truth_digest: str, protocol: str) -> dict[str, float | None]:
    return scoring.floor_of(truth_values.load(truth_digest), protocol=protocol)


def scorer(truth_digest: str, protocol: str) -> Scorer:
    """Ready for every file of an edition, with the truth as it is cached. Raises as `truth_values.load`."""
    truth: GroundTruth = truth_values.load(truth_digest)
    return _scorer(truth, protocol)


@lru_cache(maxsize=2)
def _scorer(truth: GroundTruth, protocol: str) -> Scorer:
    return Scorer(truth, get_protocol(protocol))
