"""Exports of a board that the API has answered, and the columns of its table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from evaluator.cli.values import texts_of
from evaluator.metrics.protocol import PRIMARY
from evaluator.tables import layouts
from evaluator.tables.escaping import one_line

if TYPE_CHECKING:
    from evaluator.client.answers import Board, BoardEntry


def export(board: Board, *, address: str, has_intervals: bool = False) -> layouts.Export:
    """The board that the API has answered. `address` is one at which it stays."""
    scores = board.score_names
    columns = ["rank", "method", "team", "date", "kind", *scores, "visibility"]
    if has_intervals:
        columns += ["rank_low", "rank_high", *(f"{name}_{end}" for name in scores for end in ("low", "high"))]
    return layouts.Export(
        origin=_origin(board, address=address),
        scores=scores,
        rows=_rows(board),
        columns=columns,
        records=_records(board, columns=columns),
        document=board.document,
    )


def _records(board: Board, *, columns: Sequence[str]) -> Iterator[Mapping[str, object]]:
    """`visibility` tells the rows of one's own team that others do not see, or not under this name."""
    for entry in board.entries:
        # No terminal takes them for an order, either.
        texts = [one_line(text or "") for text in (entry.method, entry.team, entry.date)]
        values = texts_of(entry, missing="", scores=board.score_names)
        ends = _ends(entry, board.score_names)
        row = (entry.rank, *texts, entry.kind, *values, entry.visibility, *ends)
        yield dict(zip(columns, row, strict=False))


def _rows(board: Board) -> Iterator[layouts.Row]:
    marks = {name: marks_of(board, name) for name in board.score_names}
    for i, entry in enumerate(board.entries):
        if entry.withdrawn_at is not None:
            continue
        team = entry.team or ""
        texts = texts_of(entry, missing=layouts.ABSENT, scores=board.score_names)
        yield layouts.Row(
            rank=rank_text(entry),
            method=layouts.marked(entry.method, mark_of(entry)),
            team=layouts.short_authors(team) if entry.kind == "published" else team,
            cells=tuple(
                layouts.Cell(
                    text=text,
                    low=end_text(entry.interval(name).low, decimals=entry.n_decimals),
                    high=end_text(entry.interval(name).high, decimals=entry.n_decimals),
                    is_best=i in marks[name][0],
                    is_second=i in marks[name][1],
                )
                for name, text in zip(board.score_names, texts, strict=True)
            ),
        )


def _origin(board: Board, *, address: str) -> layouts.Origin:
    return layouts.Origin(
        split=board.split,
        address=address,
        edition=board.edition,
        protocol=board.protocol,
        ground_truth=board.ground_truth,
        n_sequences=board.n_sequences,
        n_recordings=board.n_recordings,
        unit=board.unit,
        n_units=board.n_units,
        moment=_moment(board.at or board.updated_at),
        has_own_rows=any(mark_of(entry) for entry in board.entries if entry.withdrawn_at is None),
    )


def mark_of(entry: BoardEntry) -> str:
    """What is said of a row of one's own that others do not see as it is."""
    return layouts.mark_of(visibility=entry.visibility, pseudonym=entry.pseudonym)


def rank_text(entry: BoardEntry) -> str:
    """Its rank, and where it may stand if that was asked for."""
    found = entry.interval(PRIMARY)
    return layouts.rank_text(entry.rank, low=found.rank_low, high=found.rank_high)


def end_text(value: float | None, *, decimals: int) -> str:
    """The end of an interval; empty where there is none."""
    from evaluator.scoring.report import format_published  # noqa: PLC0415 -- loads numpy, which --help can do without

    return format_published(value, decimals=decimals, missing="")


def interval_text(entry: BoardEntry, name: str) -> str:
    """Where one of its values may lie, to stand behind it; empty where that is not known."""
    found = entry.interval(name)
    low, high = (end_text(end, decimals=entry.n_decimals) for end in (found.low, found.high))
    return f" [{low}, {high}]" if low and high else ""


def marks_of(board: Board, name: str) -> tuple[frozenset[int], frozenset[int]]:
    """The places of the best and the second of a column, among the rows that everybody sees."""
    from evaluator.metrics.metrics import best_and_second  # noqa: PLC0415 -- only once there is a board to mark

    return best_and_second(
        [None if entry.visibility == "PRIVATE" else entry.scores.get(name) for entry in board.entries]
    )


def _ends(entry: BoardEntry, scores: Sequence[str]) -> list[object]:
    ranks = entry.interval(PRIMARY)
    intervals = [entry.interval(name) for name in scores]
    ends = [
        end_text(end, decimals=entry.n_decimals) for found in intervals for end in (found.low, found.high)
    ]
    return [ranks.rank_low, ranks.rank_high, *ends]


def _moment(text: str | None) -> datetime | None:
    """The time that an answer names; None where it names none that can be read."""
    try:
        found = datetime.fromisoformat(text or "")
    except ValueError:
        return None
    return found if found.tzinfo else found.replace(tzinfo=UTC)
