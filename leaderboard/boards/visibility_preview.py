"""Preview of a method's visibility: the rows and ranks that the public would see."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from datetime import datetime
from uuid import UUID

from leaderboard.boards import listing
from leaderboard.boards.rows import Entry, Profile, profile_of
from leaderboard.models import Edition, Method, Split, Visibility


@dataclass(frozen=True)
class BoardPreview:
    """How a method would be on one split's published board."""

    split: Split
    edition: Edition
    entry: Entry
    n_ranked: int
    n_attempts_now: int | None  # what the team's public rows say until then; None if it has none there
    before: Entry | None = None  # the row that everybody sees until then
    moved: tuple["RankChange", ...] = ()


@dataclass(frozen=True)
class RankChange:
    entry: Entry
    rank_after: int | None


@dataclass(frozen=True)
class VisibilityPreview:
    """What everybody would see of a method."""

    visibility: str
    profile: Profile
    boards: tuple[BoardPreview, ...]


def preview(*, method: Method, visibility: str, now: datetime) -> VisibilityPreview:
    """What everybody would see if the method were shown like this, made as the boards themselves are."""
    assuming_visible = copy(method)
    assuming_visible.visibility = visibility
    assuming_visible.shown_at = method.shown_at or now
    public_others = Method.objects.filter(team=method.team_id, visibility=Visibility.PUBLIC)
    others = set(public_others.exclude(pk=method.pk).values_list("pk", flat=True))
    boards = []
    splits = (
        Split.objects.shown().exclude(current_edition=None).select_related("current_edition__ground_truth")
    )
    for split in splits:
        edition = split.current_edition
        rows = listing.public_rows(split=split, edition=edition, assuming_visible=assuming_visible)
        entry = next((row for row in rows if row.method_id == method.pk), None)
        if entry is not None and edition is not None:
            before = listing.public_rows(split=split, edition=edition)
            boards.append(
                BoardPreview(
                    split=split,
                    edition=edition,
                    entry=entry,
                    n_ranked=sum(row.rank is not None for row in rows),
                    n_attempts_now=next((row.n_attempts for row in before if row.method_id in others), None),
                    before=next((row for row in before if row.method_id == method.pk), None),
                    moved=_rank_changes(before, rows, method=method),
                )
            )
    return VisibilityPreview(
        visibility=visibility,
        profile=profile_of(assuming_visible, is_masked=visibility == Visibility.ANONYMOUS),
        boards=tuple(boards),
    )


def _rank_changes(
    before: Sequence[Entry], after: Sequence[Entry], *, method: Method
) -> tuple[RankChange, ...]:
    ranks = {_key(row): row.rank for row in after}
    moved = [
        RankChange(entry=row, rank_after=ranks[_key(row)])
        for row in before
        if row.method_id != method.pk and ranks[_key(row)] != row.rank
    ]
    return tuple(sorted(moved, key=lambda row: (row.entry.rank or 0, row.entry.method.casefold())))


def _key(row: Entry) -> tuple[UUID | None, str, str]:
    return (row.method_id, "", "") if row.method_id else (None, row.source, row.method)
