"""Ground truth: imported by a maintainer, and published as an edition of its split."""

import dataclasses
from collections.abc import Collection, Sequence
from datetime import datetime
from pathlib import Path
from typing import Final

from django.db import connection, transaction
from django.db.models import Max

import evaluator
from evaluator.counting import counted
from evaluator.metrics.protocol import DEFAULT_PROTOCOL, OVERALL, PROTOCOLS, get_protocol, known_ranges
from evaluator.predictions.revisions import Comparison, compare
from evaluator.units import RECORDING, Units
from leaderboard import audit, board_versions
from leaderboard.errors.refusals import Refused
from leaderboard.models import Edition, GroundTruth, Publication, Split, Submission, TruthComparison, User
from leaderboard.models.submissions import SubmissionQuerySet
from leaderboard.queue import lifecycle
from leaderboard.statistics import disclosure
from leaderboard.storage import files, hidden_marks, manifests, truth_values

# Names who imports among PostgreSQL's advisory locks: "truth" in ASCII.
_IMPORTS: Final = 0x7472757468
OPEN_PROTOCOL: Final = "tsttc-2"
"""The protocol of an open split's first edition, unless another one is named."""


def import_truth(
    *, split_name: str, path: Path, now: datetime, protocol: str | None = None, actor: User | None = None
) -> Edition:
    """Validate a split's first ground truth, keep it, and publish edition 1 with it.

    By default the protocol is `OPEN_PROTOCOL`, that of a hidden split `DEFAULT_PROTOCOL`. Returns the
    existing edition for the same ground truth and protocol. Raises `evaluator.Rejected`, `Refused` if the
    split is unknown or has other ground truth (corrections: `corrections.open_edition`), or as `new_edition`.
    """
    if protocol is not None:
        get_protocol(protocol)
    with transaction.atomic():
        row = add(split_name=split_name, path=path, now=now, actor=actor)
        split = Split.objects.select_for_update(no_key=True).get(pk=split_name)
        protocol = protocol or (DEFAULT_PROTOCOL if split.is_hidden else OPEN_PROTOCOL)
        existing = Edition.objects.filter(split=split, ground_truth=row, protocol=protocol).first()
        if existing is not None:
            return existing
        if split.current_edition is not None:
            raise Refused(
                "edition-refused",
                f"The split {split.pk!r} has {split.current_edition} with other ground truth "
                f"({split.current_edition.ground_truth.short_digest}) or rules; open a correction beside "
                f"it with: manage.py open_edition {split.pk} --truth {path.name}",
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
    """Validate a ground truth and keep it immutably. Returns the existing row for the same file.

    Raises `evaluator.Rejected`, or `Refused` if the split is unknown, the ground truth is another split's, or
    as `require_openable`.
    """
    split = Split.objects.select_related("current_edition__ground_truth").filter(name=split_name).first()
    if split is None:
        known = ", ".join(Split.objects.values_list("name", flat=True))
        raise Refused("unknown-split", f"There is no split {split_name!r}; expected one of {known}.")
    truth = evaluator.read_truth(path)
    with transaction.atomic():
        _lock_imports()
        require_openable(split, truth)
        return _kept(truth, split=split, source=path.name, now=now, actor=actor)


def _kept(
    truth: evaluator.GroundTruth, *, split: Split, source: str, now: datetime, actor: User | None
) -> GroundTruth:
    old = split.current_edition.ground_truth if split.current_edition else None
    counts = _compared(old, truth)
    n_in_ranges = {OVERALL: truth.n_sequences, **truth.counts_of(known_ranges().values())}
    for each in PROTOCOLS.values():
        n_in_ranges[GroundTruth.out_of_range_key(each)] = truth.n_outside(each.ranges)
    # Before anything is written: the mark of hidden values would stay on those of an open split.
    _require_own(split, GroundTruth.objects.filter(digest=truth.digest).first())
    truth_values.save(truth, is_hidden=split.is_hidden)
    files.save_manifest(truth.manifest)
    row, is_new = GroundTruth.objects.get_or_create(
        digest=truth.digest,
        defaults={
            "split_id": split.truth_split_id,
            "manifest_digest": truth.manifest.digest,
            "source": source[:200],
            "n_sequences": truth.manifest.n_sequences,
            "n_recordings": truth.manifest.n_recordings,
            "counts": n_in_ranges,
            "imported_at": now,
            "imported_by": actor,
        },
    )
    _require_own(split, row)
    if row.counts != n_in_ranges:  # counted before a protocol with other TTC ranges was known
        row.counts = {**row.counts, **n_in_ranges}
        row.save(update_fields=["counts"])
    if old is not None and counts is not None:
        _keep_comparison(old, row, counts)
    if is_new:
        audit.record_of(row, "imported", actor=actor)
    return row


def _lock_imports() -> None:
    """Keep other imports waiting until the transaction ends: of two with one sequence, one sees the other."""
    # SQLite has one writer at a time: a transaction that begins IMMEDIATE is it.
    if connection.vendor == "postgresql":
        with connection.cursor() as cursor:
            cursor.execute("SELECT pg_advisory_xact_lock(%s)", [_IMPORTS])


def mark_hidden() -> int:
    """Mark the values of every hidden split that were saved before there were marks. Returns how many.

    Raises `OSError` where the private directory cannot be written.
    """
    hidden = GroundTruth.objects.filter(split__is_hidden=True).order_by("imported_at", "digest")
    return truth_values.mark_hidden(hidden.values_list("digest", flat=True))


def require_openable(split: Split, truth: evaluator.GroundTruth) -> None:
    """Raise `Refused` if the ground truth has sequences of a hidden split and of an open one.

    An open split shows errors of single sequences, from which anybody computes true values.
    """
    mark_hidden()
    if split.is_hidden:
        _require_no_open_twin(split, truth)
        return
    twin = truth_values.hidden_with(truth.manifest)
    former = GroundTruth.objects.filter(split=split.truth_split_id).order_by("imported_at", "digest")
    hidden = next((row for row in former if hidden_marks.is_marked(row.digest)), None)
    if twin is not None:
        digest, key = twin
        why = f"the sequence {key} is in the hidden ground truth {digest.removeprefix('sha256:')[:8]} too"
    elif hidden is not None:
        why = f"the split's ground truth {hidden.short_digest} was imported as hidden"
    else:
        return
    raise _would_give_away(split, why)


def require_unmarked(split: Split, row: GroundTruth) -> None:
    """Raise `Refused` if the split is open, and this ground truth of it was imported as hidden."""
    if not split.is_hidden and hidden_marks.is_marked(row.digest):
        raise _would_give_away(split, f"the ground truth {row.short_digest} was imported as hidden")


def _would_give_away(split: Split, why: str) -> Refused:
    return Refused(
        "edition-refused",
        f"The split {split.pk!r} is open, and {why}. An open split shows the errors of single sequences, "
        "which would give the hidden values away; expected a ground truth without sequences of a hidden "
        f"split. If the split {split.pk!r} was hidden before, somebody has changed the database.",
    )


def _require_no_open_twin(split: Split, truth: evaluator.GroundTruth) -> None:
    rows = GroundTruth.objects.filter(split__is_hidden=False).exclude(split=split.truth_split_id)
    # The very same one is refused as another split's.
    rows = rows.exclude(digest=truth.digest)
    opened = {row.digest: row for row in rows.order_by("imported_at", "digest")}
    twin = truth_values.common_with(truth.manifest, opened)
    if twin is None:
        return
    digest, key = twin
    row = opened[digest]
    raise Refused(
        "edition-refused",
        f"The split {split.pk!r} is hidden, and the sequence {key} is in the ground truth {row.short_digest} "
        f"of the open split {row.split_id!r} too. An open split shows the errors of single sequences, so "
        "their true values are known; expected a ground truth without sequences of an open split.",
    )


def _require_own(split: Split, row: GroundTruth | None) -> None:
    if row is not None and row.split_id != split.truth_split_id:
        raise Refused(
            "edition-refused",
            f"This ground truth belongs to the split {row.split_id!r} already; a split that shares it is "
            "added at /maintain/splits/add/.",
        )


def _compared(old: GroundTruth | None, truth: evaluator.GroundTruth) -> Comparison | None:
    """Compare with `old`, if that is another one. Raises `evaluator.Rejected` without a common sequence."""
    if old is None or old.digest == truth.digest:
        return None
    comparison = compare(truth_values.load(old.digest), truth)
    if comparison.n_added == truth.n_sequences:
        message = (
            f"None of the {counted(truth.n_sequences, 'sequence')} is in the published manifest of "
            f"{old.n_sequences:,}; "
            "expected a correction of it, with the same natural keys (bag_stamp/cam_id/ts/track_id)."
        )
        raise evaluator.Rejected([evaluator.Problem("no-overlap", message)])
    return comparison


def _keep_comparison(old: GroundTruth, new: GroundTruth, counts: Comparison) -> None:
    TruthComparison.objects.update_or_create(old=old, new=new, defaults=dataclasses.asdict(counts))


def uncompared(*, readable_truths: Collection[str]) -> list[tuple[GroundTruth, GroundTruth]]:
    """Return pairs of a board's ground truth and one in preparation that are not compared yet.

    They arise when the board changes during the preparation. `readable_truths` has the digests of both.
    """
    editions = (
        Edition.objects.in_preparation()
        .filter(
            ground_truth__in=readable_truths,
            split__current_edition__ground_truth__in=readable_truths,
        )
        .select_related("ground_truth", "split__current_edition__ground_truth")
    )
    pairs = {
        (edition.split.current_edition.ground_truth, edition.ground_truth)
        for edition in editions
        if edition.split.current_edition is not None
    }
    return [
        (old, new)
        for old, new in sorted(pairs, key=lambda pair: (pair[0].pk, pair[1].pk))
        if old != new and not TruthComparison.objects.between(old, new).exists()
    ]


def count_changes(old: GroundTruth, new: GroundTruth) -> None:
    """Count and keep the differences between two ground truths. Raises as `load` does."""
    _keep_comparison(old, new, compare(truth_values.load(old.digest), truth_values.load(new.digest)))


def units_of(row: GroundTruth) -> Units:
    """Read the unit of inference of a new edition. Raises `OSError` without the manifest."""
    return manifests.load(row.manifest_digest).units


def new_edition(
    *,
    split: Split,
    row: GroundTruth,
    protocol: str,
    now: datetime,
    actor: User | None,
) -> Edition:
    """Create the next edition of a split whose row the caller has locked.

    Raises `Refused` for a protocol that would tell too much of hidden values.
    """
    allowed = disclosure.hidden_protocols()
    if split.is_hidden and protocol not in allowed:
        further = [m.title for m in get_protocol(protocol).metrics if m not in disclosure.HIDDEN_METRICS]
        raise Refused(
            "edition-refused",
            f"The ground truth of the split {split.pk!r} is hidden, and protocol {protocol!r} would tell "
            f"more of it ({', '.join(further)}) than a submission may; expected one of {', '.join(allowed)}.",
        )
    units = units_of(row)
    last = split.editions.aggregate(last=Max("number"))["last"] or 0
    edition = Edition.objects.create(
        split=split,
        number=last + 1,
        ground_truth=row,
        protocol=protocol,
        decimals=split.decimals,
        unit=units.kind,
        n_units=None if units.kind == RECORDING else len(units),
        opened_at=now,
        opened_by=actor,
    )
    audit.record_of(edition, "opened", actor=actor, details={"edition": str(edition)})
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
    """Point the split, whose row the caller has locked, at this edition, and write the changelog.

    What the edition lacks is queued: files may have been sent while nothing was queued for it.
    """
    queue_missing(edition)
    split = edition.split
    replaced = split.current_edition
    edition.published_at, edition.reopened_at = edition.published_at or now, None
    edition.save(update_fields=["published_at", "reopened_at"])
    split.current_edition = edition
    split.save(update_fields=["current_edition"])
    audit.record_of(
        edition,
        kind.lower(),
        actor=actor,
        details={"edition": str(edition), "reason": reason, "left_out": list(left_out)},
    )
    board_versions.bump(split.pk)
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


def active_submissions(edition: Edition) -> SubmissionQuerySet:
    """Return the active submissions of an edition's split, oldest first."""
    rows = Submission.objects.active().filter(split=edition.split_id)
    return rows.select_related("method__team").order_by("submitted_at")


def queue_missing(edition: Edition) -> int:
    """Queue every active submission that this edition has no evaluation of. Returns their number.

    The caller has locked the split's row, so no new submission is missed.
    """
    missing = list(
        active_submissions(edition).exclude(evaluations__edition=edition).values_list("pk", flat=True)
    )
    lifecycle.enqueue_many(submission_ids=missing, edition=edition)
    return len(missing)
