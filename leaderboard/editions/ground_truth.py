"""Ground truth: read by a maintainer, kept in a private directory, loaded by workers only.

The database has its digest and counts; the file store has its public manifest; the values are nowhere else.
"""

import dataclasses
import os
import tempfile
from collections.abc import Collection, Sequence
from datetime import datetime
from functools import lru_cache
from pathlib import Path

from django.conf import settings
from django.db import transaction
from django.db.models import Max

import evaluator
from evaluator.protocol import get_protocol
from evaluator.revisions import Comparison, compare
from leaderboard import audit, boards, files, seeds
from leaderboard.models import Edition, GroundTruth, Publication, Split, TruthComparison, User


class Refused(Exception):
    """The import cannot be done; the text says why and what to do."""


def import_truth(
    *, split_name: str, path: Path, now: datetime, protocol: str = "tsttc-1", actor: User | None = None
) -> Edition:
    """Validate a split's first ground truth, keep it immutably, and publish edition 1 with it.

    The same ground truth and protocol again is answered with the edition that has them. Raises
    `evaluator.Rejected` if the file is at fault, `Refused` if the split is unknown or has an edition with
    other ground truth (a correction is `rescoring.open_edition`); nothing is changed then.
    """
    get_protocol(protocol)
    with transaction.atomic():
        row = add(split_name=split_name, path=path, now=now, actor=actor)
        split = Split.objects.select_for_update(no_key=True).get(pk=split_name)
        existing = Edition.objects.filter(split=split, ground_truth=row, protocol=protocol).first()
        if existing is not None:
            return existing
        if split.published_edition is not None:
            raise Refused(
                f"The split {split.pk!r} has {split.published_edition} with other ground truth "
                f"({split.published_edition.ground_truth.short_digest}) or rules; open a correction beside "
                f"it with: manage.py open_edition {split.pk} --truth {path.name}"
            )
        edition = new_edition(split=split, row=row, protocol=protocol, now=now, actor=actor)
        make_board(
            edition=edition,
            kind=Publication.Kind.PUBLISHED,
            reason="The first edition.",
            now=now,
            actor=actor,
        )
    return edition


def add(*, split_name: str, path: Path, now: datetime, actor: User | None) -> GroundTruth:
    """Validate a ground truth and keep it immutably. The same file again is answered with the row it has.

    Raises `evaluator.Rejected` if the file is at fault or has no sequence of the published manifest,
    `Refused` if the split is unknown or the ground truth belongs to another one.
    """
    split = Split.objects.select_related("published_edition__ground_truth").filter(name=split_name).first()
    if split is None:
        known = ", ".join(Split.objects.values_list("name", flat=True))
        raise Refused(f"There is no split {split_name!r}; expected one of {known}.")
    truth = evaluator.read_truth(path)
    old = split.published_edition.ground_truth if split.published_edition else None
    counts = _compared(old, truth)
    _keep_values(truth, is_hidden=split.is_hidden)
    files.keep_manifest(digest=truth.manifest.digest, csv=truth.manifest.to_csv())
    with transaction.atomic():
        # The split before the audit trail, as every verb takes them: two that did it the other way round
        # could wait for each other.
        Split.objects.select_for_update(no_key=True).get(pk=split.pk)
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
        if old is not None and counts is not None:
            _keep_comparison(old, row, counts)
        if is_new:
            audit.record(verb="imported", noun="GroundTruth", noun_id=row.pk, actor=actor)
    return row


def _compared(old: GroundTruth | None, truth: evaluator.GroundTruth) -> Comparison | None:
    """What changed since `old`; None if there is nothing else. Raises `evaluator.Rejected` for no overlap."""
    if old is None or old.digest == truth.digest:
        return None
    comparison = compare(load(old.digest), truth)
    if comparison.n_added == truth.n_sequences:
        message = (
            f"None of the {truth.n_sequences:,} sequences is in the published manifest of "
            f"{old.n_sequences:,}; "
            "expected a correction of it, with the same natural keys (bag_stamp/cam_id/ts/track_id)."
        )
        raise evaluator.Rejected([evaluator.Problem("no-overlap", message)])
    return comparison


def _keep_comparison(old: GroundTruth, new: GroundTruth, counts: Comparison) -> None:
    TruthComparison.objects.update_or_create(old=old, new=new, defaults=dataclasses.asdict(counts))


def uncompared(*, held: Collection[str]) -> list[tuple[GroundTruth, GroundTruth]]:
    """The board's ground truth and that of an edition beside it, where nobody has counted what differs.

    So it is after the board has changed while an edition was being prepared. Only pairs that are both among
    the digests `held`.
    """
    beside = Edition.objects.filter(
        published_at=None,
        discarded_at=None,
        ground_truth__in=held,
        split__published_edition__ground_truth__in=held,
    ).select_related("ground_truth", "split__published_edition__ground_truth")
    pairs = {
        (edition.split.published_edition.ground_truth, edition.ground_truth)
        for edition in beside
        if edition.split.published_edition is not None
    }
    return [
        (old, new)
        for old, new in sorted(pairs, key=lambda pair: (pair[0].pk, pair[1].pk))
        if old != new and not TruthComparison.objects.between(old, new).exists()
    ]


def count_changes(old: GroundTruth, new: GroundTruth) -> None:
    """Count what differs between two ground truths, for whoever asks later. Raises as `load` does."""
    _keep_comparison(old, new, compare(load(old.digest), load(new.digest)))


def new_edition(
    *,
    split: Split,
    row: GroundTruth,
    protocol: str,
    now: datetime,
    actor: User | None,
    decimals: int | None = None,
) -> Edition:
    """The next edition of a split whose row the caller has locked; not yet its board.

    It publishes with the split's decimals of this moment, or with `decimals`, for ever.
    """
    last = split.editions.aggregate(last=Max("number"))["last"] or 0
    edition = Edition.objects.create(
        split=split,
        number=last + 1,
        ground_truth=row,
        protocol=protocol,
        decimals=split.decimals if decimals is None else decimals,
        opened_at=now,
        opened_by=actor,
    )
    audit.record(
        verb="opened", noun="Edition", noun_id=edition.pk, actor=actor, details={"edition": str(edition)}
    )
    return edition


def make_board(
    *,
    edition: Edition,
    kind: Publication.Kind,
    reason: str,
    now: datetime,
    actor: User | None,
    left_out: Sequence[str] = (),
) -> Publication:
    """Point the split, whose row the caller has locked, at this edition, and write the changelog."""
    split = edition.split
    replaced = split.published_edition
    if edition.published_at is None:
        edition.published_at = now
        edition.save(update_fields=["published_at"])
    split.published_edition = edition
    split.save(update_fields=["published_edition"])
    boards.changed(split.pk)
    audit.record(
        verb=kind.lower(),
        noun="Edition",
        noun_id=edition.pk,
        actor=actor,
        details={"edition": str(edition), "reason": reason, "left_out": list(left_out)},
    )
    return Publication.objects.create(
        split=split,
        edition=edition,
        replaced=replaced,
        kind=kind,
        at=now,
        by=actor,
        reason=reason,
        left_out=list(left_out),
    )


def values_path(digest: str) -> Path:
    """Where the worker finds the values of this digest."""
    return Path(settings.GROUND_TRUTH_DIR) / f"{digest.removeprefix('sha256:')}.npz"


def manifest_path(digest: str) -> Path:
    """Where the worker finds the manifest of the ground truth of this digest, without the values."""
    return Path(settings.GROUND_TRUTH_DIR) / f"{digest.removeprefix('sha256:')}.manifest.npz"


def is_marked_hidden(digest: str) -> bool:
    """Whether the values of this digest were imported as hidden ones, whatever the database says today.

    Who can write into the database could call a split open; the private directory tells workers otherwise.
    """
    return _mark_path(digest).exists()


def _mark_path(digest: str) -> Path:
    return Path(settings.GROUND_TRUTH_DIR) / f"{digest.removeprefix('sha256:')}.hidden"


def _keep_values(truth: evaluator.GroundTruth, *, is_hidden: bool) -> None:
    """Write values and manifest to the private directory: whole or not at all, readable by its owner only.

    Hidden ones are marked as such, before they can be read.
    """
    directory = Path(settings.GROUND_TRUTH_DIR)
    directory.mkdir(parents=True, exist_ok=True, mode=0o700)
    if is_hidden:
        _mark_path(truth.digest).touch(mode=0o600)
    for part, target in ((truth, values_path(truth.digest)), (truth.manifest, manifest_path(truth.digest))):
        if target.exists():
            continue
        handle, temporary = tempfile.mkstemp(dir=directory, suffix=".npz")
        os.close(handle)
        part.save(Path(temporary))
        with Path(temporary).open("rb") as written:
            os.fsync(written.fileno())
        Path(temporary).replace(target)
    seeds.ensure()


def held() -> frozenset[str]:
    """The digests whose values this process can read: what it may take on. Empty without any access."""
    try:
        found = list(Path(settings.GROUND_TRUTH_DIR).iterdir())
    except OSError:
        return frozenset()
    values = (path for path in found if path.suffix == ".npz" and not path.stem.endswith(".manifest"))
    return frozenset(f"sha256:{path.stem}" for path in values if os.access(path, os.R_OK))


@lru_cache(maxsize=2)
def load(digest: str) -> evaluator.GroundTruth:
    """The values of this digest, for a worker. Raises `OSError` if this process has no access to them."""
    return evaluator.GroundTruth.load(values_path(digest))
