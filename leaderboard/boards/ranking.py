"""Ranking: ranks, marks, and the order in which rows are listed."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime

from evaluator.metrics import ranking
from evaluator.metrics.protocol import PRIMARY
from leaderboard.boards.rows import Entry, placed

Place = tuple[bool, float, datetime]


def key(value: float | None, submitted_at: datetime) -> Place:
    """Of a method's submissions, the better first: a value before none, lower before higher, then earlier."""
    return (value is None, value or 0.0, submitted_at)


def in_ranks(entries: Sequence[Entry]) -> tuple[Entry, ...]:
    """The same rows with their ranks, and with the best and the second of each column marked."""
    ranks = ranking.rank([entry.scores[PRIMARY] for entry in entries])
    names = list(entries[0].scores) if entries else []
    marks = {name: ranking.best_and_second([entry.scores[name] for entry in entries]) for name in names}
    return tuple(
        replace(
            placed(entry, rank),
            best=frozenset(name for name, (best, _) in marks.items() if i in best),
            second=frozenset(name for name, (_, second) in marks.items() if i in second),
        )
        for i, (entry, rank) in enumerate(zip(entries, ranks, strict=True))
    )


def listed(entries: Sequence[Entry], *, by: str) -> list[Entry]:
    """In the order of one column; rows without a value come last, ties by rank, value and name."""
    column = by.removeprefix("-")
    in_rank_order = sorted(
        entries, key=lambda e: (e.rank or len(entries) + 1, e.scores[PRIMARY] or 0, e.method.casefold())
    )

    def value(entry: Entry) -> str | float | int | None:
        if column in entry.scores:
            return entry.scores[column]
        if column == "rank":
            return entry.rank
        if column == "date":
            return entry.date_text or None
        return (entry.method if column == "method" else entry.team).casefold()

    valued = [entry for entry in in_rank_order if value(entry) is not None]
    without = [entry for entry in in_rank_order if value(entry) is None]
    valued.sort(key=value, reverse=by.startswith("-"))  # type: ignore[arg-type]  # one column, one type
    return [*valued, *without]
