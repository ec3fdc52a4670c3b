"""The history of editions: when each was published and replaced, and how a correction changed an entry."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from django.db.models import Count, QuerySet

from leaderboard.editions import corrections
from leaderboard.models import (
    Edition,
    Evaluation,
    GroundTruth,
    Publication,
    Split,
    Status,
    Submission,
    TruthComparison,
)


@dataclass(frozen=True)
class EditionRecord:
    edition: Edition
    followed: Edition | None  # the board that it first replaced
    change: "TruthChange | None"  # of the ground truth since then; None where the two were never compared
    replaced_by: Publication | None  # None while it is the board
    publications: tuple[Publication, ...] = ()  # each time that it became the board, the newest first

    @property
    def is_board(self) -> bool:
        return self.replaced_by is None


@dataclass(frozen=True)
class TruthChange:
    """By how many sequences one ground truth differs from another."""

    n_added: int
    n_removed: int
    n_changed: int  # in both, with another time to contact
    n_renumbered: int | None  # in both, with another anno_id; None where it was not counted in its time


@dataclass(frozen=True)
class Rescored:
    """The evaluations of a submission before and after the last change of the board."""

    publication: Publication
    old: Evaluation | None
    new: Evaluation | None


def changelog(split: Split) -> QuerySet[Publication]:
    """Return every change of a split's board, newest first."""
    rows = split.publications.select_related("edition__ground_truth", "replaced__ground_truth")
    return rows.order_by("-at", "-pk")


def latest_change(split: Split) -> Publication | None:
    """Return the change that made the present board; None for the first board."""
    latest = changelog(split).first()
    return latest if latest and latest.replaced_id else None


def latest_changes(splits: Iterable[Split], n: int) -> list[Publication]:
    """Return the last changes of these splits' boards, newest first."""
    rows = Publication.objects.filter(split__in=splits)
    rows = rows.select_related("split", "edition__ground_truth", "replaced__ground_truth")
    return list(rows.order_by("-at", "-pk")[:n])


def history(split: Split, publications: Iterable[Publication]) -> tuple[EditionRecord, ...]:
    """Return every published edition, newest first; `publications` are the split's changelog."""
    published = split.editions.exclude(published_at=None).select_related("ground_truth")
    # All at once, since each edition that followed another asks for one.
    rows = TruthComparison.objects.filter(new__split=split.truth_split_id).order_by("pk")
    has_followed = any(publication.replaced_id for publication in publications)
    compared = list(rows) if has_followed else []
    return tuple(record_of(each, publications, compared) for each in published.order_by("-number"))


def record_of(
    edition: Edition,
    publications: Iterable[Publication] | None = None,
    compared: Sequence[TruthComparison] | None = None,
) -> EditionRecord:
    """Return the record of a published edition; reads what is not given."""
    log = changelog(edition.split) if publications is None else publications
    own = tuple(each for each in log if each.edition_id == edition.pk)
    replaced_by = next((each for each in log if each.replaced_id == edition.pk), None)
    is_board = edition.split.current_edition_id == edition.pk
    followed = own[-1].replaced if own else None
    return EditionRecord(
        edition=edition,
        followed=followed,
        change=change_of_truth(followed.ground_truth, edition.ground_truth, compared) if followed else None,
        replaced_by=None if is_board else replaced_by,
        publications=own,
    )


def change_of_truth(
    before: GroundTruth, after: GroundTruth, compared: Sequence[TruthComparison] | None = None
) -> TruthChange | None:
    """Return the differences of two ground truths; None if they were never compared.

    `compared` are comparisons that were read already.
    """
    if before.pk == after.pk:
        return TruthChange(0, 0, 0, 0)
    if compared is None:
        compared = list(TruthComparison.objects.between(before, after).order_by("pk"))
    pair = {before.pk, after.pk}
    comparison = next((row for row in reversed(compared) if {row.old_id, row.new_id} == pair), None)
    if comparison is None:
        return None
    added, removed = comparison.n_added, comparison.n_removed
    if comparison.old_id == after.pk:
        added, removed = removed, added
    return TruthChange(added, removed, comparison.n_changed, comparison.n_renumbered)


def rescored(submission: Submission) -> Rescored | None:
    """Return what the last change of the board did to an active submission; None for a later submission."""
    publication = latest_change(submission.split)
    if publication is None or publication.at <= submission.submitted_at or submission.withdrawn_at:
        return None
    evaluations = {
        evaluation.edition_id: evaluation
        for evaluation in submission.evaluations.filter(
            edition__in=[publication.edition_id, publication.replaced_id]
        )
        .select_related("edition")
        .prefetch_related("scores")
    }
    return Rescored(
        publication=publication,
        old=evaluations.get(publication.replaced_id or 0),
        new=evaluations.get(publication.edition_id),
    )


def maintainer_overview(split: Split) -> dict[str, Any]:
    """Return the editions of a split for maintainers, and system errors."""
    rows = list(split.editions.select_related("ground_truth", "split").order_by("-number"))
    published = next((e for e in rows if e.pk == split.current_edition_id), None)
    failed = Evaluation.objects.filter(status=Status.SYSTEM_ERROR, submission__withdrawn_at=None)
    n_failed = dict(
        failed.filter(edition__in=rows).values_list("edition").annotate(n=Count("pk")).order_by("edition")
    )
    return {
        "split": split,
        "published": published,
        "former": [e for e in rows if e.published_at and e != published and not e.is_in_preparation],
        "in_preparation": [(e, corrections.progress(e)) for e in rows if e.is_in_preparation],
        "system_errors": [(e, n_failed[e.pk]) for e in rows if e.pk in n_failed],
        # What rolling back returns to.
        "predecessor": corrections.predecessor(split),
    }


def manifest_digest(*, split: Split, number: str) -> str | None:
    """Return the digest of the manifest of the board, or of a published edition's number."""
    if not number:
        return split.current_edition.ground_truth.manifest_digest if split.current_edition else None
    if not (number.isascii() and number.isdigit() and len(number) < 7):
        return None
    editions = split.editions.filter(number=int(number)).exclude(published_at=None)
    return editions.values_list("ground_truth__manifest_digest", flat=True).first()
