"""Results of one method: its row on the board of each split, and the submissions behind it."""

from collections.abc import Sequence
from dataclasses import dataclass

from django.contrib.auth.models import AnonymousUser

from evaluator.metrics import registry
from leaderboard.boards import listing, snapshots
from leaderboard.boards.rows import Entry, Profile, placed, profile_of
from leaderboard.boards.snapshots import Attempt
from leaderboard.models import Edition, Method, Split, User


def profile(*, method: Method, viewer: User | AnonymousUser) -> Profile:
    """The profile of a visible method as this reader sees it: masked if it is anonymous."""
    return profile_of(method, is_masked=not method.is_named_for(viewer))


@dataclass(frozen=True)
class Result:
    """The row of a method on one published board, and its submissions."""

    split: Split
    edition: Edition
    entry: Entry
    n_ranked: int
    attempts: tuple[Attempt, ...]  # its active, scored submissions, the newest first
    rows: tuple[Entry, ...]  # those that everybody sees
    best: Entry | None  # of the others among them, as the viewer reads it; None without any
    neighbours: tuple[Entry, ...]  # up to two of them, of the nearest rank

    @property
    def rivals(self) -> tuple[Entry, ...]:
        """The best of the others and the neighbours, each once."""
        first = (self.best,) if self.best else ()
        return tuple({other.id: other for other in (*first, *self.neighbours)}.values())


@dataclass(frozen=True)
class OwnRows:
    """The rows with a value that a reader's team has on one published board, the best first."""

    split: Split
    rows: tuple[Entry, ...]  # those that everybody sees
    own: tuple[Entry, ...]  # never empty

    @property
    def n_ranked(self) -> int:
        """Return the number of ranks, with the best of one's own among them."""
        return sum(row.rank is not None for row in self.rows) + (not self.own[0].is_visible_to_all)


def own_rows(*, viewer: User, splits: Sequence[Split]) -> list[OwnRows]:
    """Return the rows of a reader's team on each board where it has any."""
    boards = []
    for split, drawn in snapshots.shown_on(splits):
        entries = listing.with_own(drawn.entries, split=split, edition=split.current_edition, viewer=viewer)
        own = [entry for entry in entries if entry.is_mine and entry.value is not None]
        if own:
            own.sort(key=lambda entry: entry.value or 0.0)
            boards.append(OwnRows(split, drawn.entries, tuple(own)))
    return boards


def results(
    *, method: Method, viewer: User | AnonymousUser, splits: Sequence[Split] | None = None
) -> tuple[Result, ...]:
    """Return a result for each split on whose published board the viewer sees the method.

    `splits` are those of `snapshots.splits()`, where they are at hand.
    """
    per_split = []
    for split, drawn in snapshots.shown_on(splits if splits is not None else snapshots.splits()):
        edition = split.current_edition
        entries = listing.with_own(drawn.entries, split=split, edition=edition, viewer=viewer)
        entry = next((entry for entry in entries if entry.method_id == method.pk), None)
        if entry is None or edition is None:
            continue
        is_shown = entry.is_visible_to_all
        # One that is private is counted where it would stand.
        ranked = drawn.entries if is_shown else (*drawn.entries, entry)
        n_ranked = sum(other.rank is not None for other in ranked)
        # What is private is not among what everybody sees.
        own = snapshots.attempts(edition, methods=Method.objects.filter(pk=method.pk)) if not is_shown else ()
        attempts = own or tuple(each for each in drawn.attempts if each.method_id == method.pk)
        others = _others(entry, [row for row in entries if row.is_visible_to_all])
        best = others[0] if others else None
        neighbours = _neighbours(entry, others)
        edition.split = split  # It is at hand, and would be asked for again.
        per_split.append(Result(split, edition, entry, n_ranked, attempts, drawn.entries, best, neighbours))
    return tuple(per_split)


def _others(entry: Entry, rows: Sequence[Entry]) -> list[Entry]:
    """The other rows with a value, the best first, ranked as if the entry were among what everybody sees."""
    value = entry.value
    if value is None:
        return []
    others = [row for row in rows if row.method_id != entry.method_id and row.value is not None]
    ranks = registry.rank([value, *(row.value for row in others)])[1:]
    ranked = [placed(row, rank) for row, rank in zip(others, ranks, strict=True)]
    return sorted(ranked, key=lambda row: row.value or 0.0)


def _neighbours(entry: Entry, others: Sequence[Entry]) -> tuple[Entry, ...]:
    """The row before and the row after; at an end of the board the two next to it."""
    n_better = sum((row.value or 0.0) < (entry.value or 0.0) for row in others)
    first = min(max(n_better - 1, 0), max(len(others) - 2, 0))
    return tuple(others[first : first + 2])
