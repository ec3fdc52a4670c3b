"""Ground truth: read by a maintainer, kept in a private directory, loaded by workers only.

The database has its digest and counts; the file store has its public manifest; the values are nowhere else.
"""

import os
import tempfile
from datetime import datetime
from functools import lru_cache
from pathlib import Path

from django.conf import settings
from django.db import transaction
from django.db.models import Max

import evaluator
from evaluator.protocol import get_protocol
from leaderboard import audit, files
from leaderboard.models import Edition, GroundTruth, Split, User


class Refused(Exception):
    """The import cannot be done; the text says why and what to do."""


def import_truth(
    *, split_name: str, path: Path, now: datetime, protocol: str = "tsttc-1", actor: User | None = None
) -> Edition:
    """Validate a ground truth, keep it immutably, and open an edition of the split with it.

    The split's first edition is published at once. The same ground truth and protocol again is answered with
    the edition that has them. Raises `evaluator.Rejected` if the file is at fault, `Refused` if the split is
    unknown or has an edition with other ground truth; nothing is changed then.
    """
    get_protocol(protocol)
    split = Split.objects.filter(name=split_name).first()
    if split is None:
        known = ", ".join(Split.objects.values_list("name", flat=True))
        raise Refused(f"There is no split {split_name!r}; expected one of {known}.")
    truth = evaluator.read_truth(path)
    _keep_values(truth)
    files.keep_manifest(digest=truth.manifest.digest, csv=truth.manifest.to_csv())
    with transaction.atomic():
        split = Split.objects.select_for_update().get(pk=split.pk)
        row, is_new = GroundTruth.objects.get_or_create(
            digest=truth.digest,
            defaults={
                "split": split,
                "manifest_digest": truth.manifest.digest,
                "source": path.name[:200],
                "n_sequences": truth.manifest.n_sequences,
                "n_recordings": truth.manifest.n_recordings,
                "counts": {
                    "overall": truth.n_sequences,
                    **truth.interval_counts,
                    "out_of_range": truth.n_out_of_range,
                },
                "imported_at": now,
                "imported_by": actor,
            },
        )
        if row.split_id != split.pk:
            raise Refused(f"This ground truth belongs to the split {row.split_id!r} already.")
        if is_new:
            audit.record(verb="imported", noun="GroundTruth", noun_id=row.pk, actor=actor)
        return _first_edition(split=split, row=row, protocol=protocol, now=now, actor=actor)


def _first_edition(
    *, split: Split, row: GroundTruth, protocol: str, now: datetime, actor: User | None
) -> Edition:
    existing = Edition.objects.filter(split=split, ground_truth=row, protocol=protocol).first()
    if existing is not None:
        return existing
    if split.published_edition is not None:
        raise Refused(
            f"The split {split.pk!r} has {split.published_edition} with other ground truth "
            f"({split.published_edition.ground_truth.short_digest}); a correction is a new edition beside it."
        )
    last = split.editions.aggregate(last=Max("number"))["last"] or 0
    edition = Edition.objects.create(
        split=split,
        number=last + 1,
        ground_truth=row,
        protocol=protocol,
        opened_at=now,
        opened_by=actor,
        published_at=now,
    )
    split.published_edition = edition
    split.save(update_fields=["published_edition"])
    audit.record(verb="published", noun="Edition", noun_id=str(edition), actor=actor)
    return edition


def values_path(digest: str) -> Path:
    """Where the worker finds the values of this digest."""
    return Path(settings.GROUND_TRUTH_DIR) / f"{digest.removeprefix('sha256:')}.npz"


def manifest_path(digest: str) -> Path:
    """Where the worker finds the manifest of the ground truth of this digest, without the values."""
    return Path(settings.GROUND_TRUTH_DIR) / f"{digest.removeprefix('sha256:')}.manifest.npz"


def _keep_values(truth: evaluator.GroundTruth) -> None:
    """Write values and manifest to the private directory: whole or not at all, readable by its owner only."""
    directory = Path(settings.GROUND_TRUTH_DIR)
    directory.mkdir(parents=True, exist_ok=True, mode=0o700)
    for part, target in ((truth, values_path(truth.digest)), (truth.manifest, manifest_path(truth.digest))):
        if target.exists():
            continue
        handle, temporary = tempfile.mkstemp(dir=directory, suffix=".npz")
        os.close(handle)
        part.save(Path(temporary))
        with Path(temporary).open("rb") as written:
            os.fsync(written.fileno())
        Path(temporary).replace(target)


@lru_cache(maxsize=2)
def load(digest: str) -> evaluator.GroundTruth:
    """The values of this digest, for a worker. Raises `OSError` if this process has no access to them."""
    return evaluator.GroundTruth.load(values_path(digest))
