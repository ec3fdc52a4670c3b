"""How far ranks have moved in a month, read once a day, and what has changed on a board since a time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, time, timedelta
from typing import Final
from uuid import UUID

from django.core.cache import caches

from leaderboard.boards import listing
from leaderboard.boards.listing import Board
from leaderboard.boards.rows import Entry

MONTH: Final = timedelta(days=30)

_A_DAY_S: Final = 86_400


def since(*, now: datetime) -> datetime:
    """Return the end of the day that ranks are compared with."""
    return datetime.combine((now - MONTH).astimezone(UTC).date(), time.max, tzinfo=UTC)


def moved(board: Board, *, now: datetime) -> Mapping[UUID, int]:
    """Return by how many ranks each method has risen in a month; fallen: below 0."""
    edition = board.edition
    if board.at is not None or edition is None or edition.pk != board.split.current_edition_id:
        return {}
    before = _ranks_before(board, at=since(now=now))
    return {
        entry.method_id: before[entry.method_id] - entry.rank
        for entry in board.entries
        if entry.method_id in before and entry.rank is not None and entry.is_visible_to_all
    }


def _ranks_before(board: Board, *, at: datetime) -> dict[UUID, int]:
    split, edition = board.split, board.edition
    if edition is None or edition.published_at is None or edition.published_at > at:
        return {}

    def ranks() -> dict[UUID, int]:
        if listing.edition_at(split, at) != edition:
            return {}
        rows = listing.public_rows(split=split, edition=edition, at=at)
        return {row.method_id: row.rank for row in rows if row.method_id and row.rank}

    key = f"ranks:{split.pk}:{edition.pk}:{at.isoformat()}"
    return caches["boards"].get_or_set(key, ranks, _A_DAY_S) or {}


@dataclass(frozen=True)
class Change:
    """One row on two boards; None on the one that does not have it."""

    before: Entry | None
    after: Entry | None

    @property
    def entry(self) -> Entry:
        """Return the row as it is now, or as it was last."""
        return self.after or self.before  # type: ignore[return-value]  # one of them is there


def changes(before: Sequence[Entry], after: Sequence[Entry]) -> list[Change]:
    """Return the rows with another rank or value, those gone or withdrawn, and the new ones, each by rank.

    A row that came and was withdrawn in between is none of them.
    """
    former, present = ({entry.id: entry for entry in rows} for rows in (before, after))
    pairs = [Change(former.get(key), present.get(key)) for key in present | former]
    changed = [pair for pair in pairs if _state(pair.before) != _state(pair.after)]
    return sorted(changed, key=lambda pair: (pair.before is None, pair.after is None, _order(pair.entry)))


def _state(entry: Entry | None) -> tuple[object, ...] | None:
    return (entry.rank, entry.value) if entry and not entry.withdrawn_at else None


def _order(entry: Entry) -> tuple[bool, int, str]:
    return entry.rank is None, entry.rank or 0, entry.method.casefold()
