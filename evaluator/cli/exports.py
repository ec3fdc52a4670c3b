"""A board as a table for papers, notes and spreadsheets: LaTeX and Markdown as the site has them, and CSV."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Final

from evaluator import layouts
from evaluator.cli.values import texts_of
from evaluator.escaping import csv_line, one_line
from evaluator.protocol import SCORE_NAMES

if TYPE_CHECKING:
    from evaluator.answers import Board, BoardEntry

_COLUMNS: Final = ("rank", "method", "team", "date", "kind", *SCORE_NAMES, "visibility")
_OF_INTERVALS: Final = (
    *("rank_low", "rank_high"),
    *(f"{name}_{end}" for name in SCORE_NAMES for end in ("low", "high")),
)


def as_csv(board: Board, *, has_intervals: bool = False) -> str:
    """One line for each entry; numbers as they are published, empty where there is none.

    `visibility` tells the rows of one's own team that others do not see, or not under this name.
    """
    lines = [",".join((*_COLUMNS, *(_OF_INTERVALS if has_intervals else ()))) + "\n"]
    for entry in board.entries:
        # No terminal takes them for an order, either.
        texts = [one_line(text or "") for text in (entry.method, entry.team, entry.date)]
        values = [*texts_of(entry, missing=""), entry.visibility, *(_ends(entry) if has_intervals else ())]
        lines.append(csv_line((entry.rank, *texts, entry.kind, *values), end="\n"))
    return "".join(lines)


def as_latex(board: Board, *, address: str) -> str:
    """A `tabular` for the package booktabs; the best of a column is bold, the second underlined."""
    return layouts.as_latex(_rows(board), about=_about(board, address))


def as_markdown(board: Board, *, address: str) -> str:
    """A table of GitHub's Markdown; the best of a column is bold, the second italic."""
    return layouts.as_markdown(_rows(board), about=_about(board, address))


def mark_of(entry: BoardEntry) -> str:
    """What is said of a row of one's own that others do not see as it is."""
    return layouts.mark_of(visibility=entry.visibility, pseudonym=entry.pseudonym)


def rank_text(entry: BoardEntry) -> str:
    """Its rank, and where it may stand if that was asked for."""
    found = entry.interval("mid")
    return layouts.rank_text(entry.rank, low=found.rank_low, high=found.rank_high)


def end_text(value: float | None, *, decimals: int) -> str:
    """The end of an interval; empty where there is none."""
    from evaluator.report import format_published  # noqa: PLC0415 -- loads numpy, which --help can do without

    return format_published(value, decimals=decimals, missing="")


def interval_text(entry: BoardEntry, name: str) -> str:
    """Where one of its values may lie, to stand behind it; empty where that is not known."""
    found = entry.interval(name)
    low, high = (end_text(end, decimals=entry.n_decimals) for end in (found.low, found.high))
    return f" [{low}, {high}]" if low and high else ""


def marks_of(board: Board, name: str) -> tuple[frozenset[int], frozenset[int]]:
    """The places of the best and the second of a column, among the rows that everybody sees."""
    from evaluator.ranking import best_and_second  # noqa: PLC0415 -- only once there is a board to mark

    best, second = best_and_second(
        [None if entry.visibility == "PRIVATE" else entry.scores.get(name) for entry in board.entries]
    )
    return frozenset(best), frozenset(second)


def _number(value: int | None) -> str:
    return "" if value is None else str(value)


def _ends(entry: BoardEntry) -> list[str]:
    ranks = entry.interval("mid")
    intervals = [entry.interval(name) for name in SCORE_NAMES]
    ends = [
        end_text(end, decimals=entry.n_decimals) for found in intervals for end in (found.low, found.high)
    ]
    return [_number(ranks.rank_low), _number(ranks.rank_high), *ends]


def _rows(board: Board) -> list[layouts.Row]:
    marks = {name: marks_of(board, name) for name in SCORE_NAMES}
    return [
        layouts.Row(
            rank=rank_text(entry),
            method=layouts.marked(entry.method, mark_of(entry)),
            team=layouts.short_authors(entry.team or "") if entry.kind == "published" else entry.team or "",
            cells=tuple(
                layouts.Cell(
                    text=text,
                    low=end_text(entry.interval(name).low, decimals=entry.n_decimals),
                    high=end_text(entry.interval(name).high, decimals=entry.n_decimals),
                    is_best=i in marks[name][0],
                    is_second=i in marks[name][1],
                )
                for name, text in zip(SCORE_NAMES, texts_of(entry, missing=layouts.ABSENT), strict=True)
            ),
        )
        for i, entry in enumerate(board.entries)
        if entry.withdrawn_at is None
    ]


def _about(board: Board, address: str) -> tuple[str, ...]:
    origin = layouts.Origin(
        split=board.split,
        address=address,
        edition=board.edition,
        protocol=board.protocol,
        ground_truth=board.ground_truth,
        n_sequences=board.n_sequences,
        n_recordings=board.n_recordings,
        moment=_moment(board.at or board.updated_at),
        has_own_rows=any(mark_of(entry) for entry in board.entries if entry.withdrawn_at is None),
    )
    return layouts.about(origin)


def _moment(text: str | None) -> datetime | None:
    """The time that an answer names; None where it names none that can be read."""
    try:
        found = datetime.fromisoformat(text or "")
    except ValueError:
        return None
    return found if found.tzinfo else found.replace(tzinfo=UTC)
