"""Tables to take along: a board as CSV, LaTeX and Markdown, and any rows as CSV.

Every number is the text that the page shows. The texts of strangers are shown as they are and have no power
over what is around them, in a spreadsheet, a paper or a note.

What a board holds is for whoever draws it to decide. A row of one's own that others do not see as it is says
so in every form: in a paper it would tell them.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, fields, replace
from typing import Final

from evaluator import layouts
from evaluator.escaping import csv_line
from evaluator.protocol import METRICS, SCORE_NAMES
from evaluator.report import format_published
from leaderboard.entries import Details, Entry, Interval
from leaderboard.filters import BadFilter
from leaderboard.keeping import one_of
from leaderboard.standings import Board

short_authors = layouts.short_authors
_DETAILS: Final = tuple(field.name for field in fields(Details))
CSV_COLUMNS: Final = (
    *("rank", "rank_low", "rank_high", "kind", "method", "team", "date"),
    *SCORE_NAMES,
    *("n_attempts", *_DETAILS, "description", "paper_url", "code_url", "source"),
    *("method_id", "withdrawn_at", "visibility"),
)
"""Of a board; with intervals the lower and upper ends of the ten values follow."""

INTERVAL_COLUMNS: Final = tuple(f"{name}_{end}" for name in SCORE_NAMES for end in ("low", "high"))


def csv_text(rows: Iterable[Mapping[str, object]], *, columns: Sequence[str]) -> str:
    """Rows as CSV with a header (RFC 4180). Texts are guarded and quoted, numbers stay, None is empty."""
    return "".join(csv_lines(rows, columns=columns))


def csv_lines(rows: Iterable[Mapping[str, object]], *, columns: Sequence[str]) -> Iterator[str]:
    """The same, one row after the other, for tables that are too long to be held."""
    yield ",".join(columns) + "\r\n"
    for row in rows:
        yield csv_line(row.get(name) for name in columns)


WITH_INTERVALS: Final = {"1": True, "yes": True, "0": False, "no": False}
YES_OR_NO: Final = one_of("", *WITH_INTERVALS)


def has_intervals(text: str) -> bool:
    """Whether an address asks for intervals; without a word it does not. Raises `filters.BadFilter`."""
    return is_asked_for("intervals", text)


def is_asked_for(name: str, text: str) -> bool:
    """Whether an address asks for more than usual; without a word it does not. Raises `filters.BadFilter`."""
    if text and text not in WITH_INTERVALS:
        raise BadFilter(name, text, f"one of {', '.join(WITH_INTERVALS)}")
    return WITH_INTERVALS.get(text, False)


def mark_of(entry: Entry) -> str:
    """What is said of a row of one's own that others do not see as it is; nothing of any other row."""
    return layouts.mark_of(visibility=entry.visibility, pseudonym=entry.pseudonym)


# --- a board ---------------------------------------------------------------------------------------------


def board_csv(board: Board, *, has_intervals: bool = False) -> str:
    """Every row of a board, as it is shown: one line for each, empty cells where nothing is known."""
    columns = (*CSV_COLUMNS, *(INTERVAL_COLUMNS if has_intervals else ()))
    rows = (_csv_row(entry, has_intervals=has_intervals) for entry in board.entries)
    return csv_text(rows, columns=columns)


def _csv_row(entry: Entry, *, has_intervals: bool) -> dict[str, object]:
    ranks = entry.intervals.get("mid", Interval())
    row: dict[str, object] = {
        "rank": entry.rank,
        "rank_low": ranks.rank_low,
        "rank_high": ranks.rank_high,
        **{name: getattr(entry, name) for name in ("kind", "method", "team", "n_attempts")},
        "date": entry.date_text,
        **{
            name: format_published(entry.scores[name], decimals=entry.decimals, missing="")
            for name in SCORE_NAMES
        },
        **asdict(entry.details),
        **{name: getattr(entry, name) for name in ("description", "paper_url", "code_url", "source")},
        "method_id": entry.method_id,
        "withdrawn_at": entry.withdrawn_at.isoformat() if entry.withdrawn_at else None,
        "visibility": entry.visibility,
    }
    if has_intervals:
        for name in SCORE_NAMES:
            found = entry.intervals.get(name, Interval())
            row[f"{name}_low"] = format_published(found.low, decimals=entry.decimals, missing="")
            row[f"{name}_high"] = format_published(found.high, decimals=entry.decimals, missing="")
    return row


def board_latex(
    board: Board, *, address: str, metrics: Sequence[str] = METRICS, has_intervals: bool = False
) -> str:
    """A board as a table of LaTeX (booktabs), without what was withdrawn; comments say what it is."""
    rows = _layout(board, metrics=metrics, has_intervals=has_intervals)
    return layouts.as_latex(rows, about=about(board, address=address), metrics=metrics)


def board_markdown(
    board: Board, *, address: str, metrics: Sequence[str] = METRICS, has_intervals: bool = False
) -> str:
    """A board as a table of Markdown, without what was withdrawn; below it stands what it is."""
    rows = _layout(board, metrics=metrics, has_intervals=has_intervals)
    return layouts.as_markdown(rows, about=about(board, address=address), metrics=metrics)


def about(board: Board, *, address: str) -> tuple[str, ...]:
    """What a table was taken from: enough to find it again when the board has moved on."""
    truth = board.edition.ground_truth if board.edition else None
    origin = layouts.Origin(
        split=board.split.pk,
        address=address,
        edition=board.edition.number if board.edition else None,
        protocol=board.edition.protocol if board.edition else None,
        ground_truth=truth.digest if truth else None,
        n_sequences=truth.n_sequences if truth else None,
        n_recordings=truth.n_recordings if truth else None,
        moment=board.at or board.updated_at,
        has_own_rows=any(mark_of(entry) for entry in board.entries if entry.withdrawn_at is None),
    )
    return layouts.about(origin)


def _layout(board: Board, *, metrics: Sequence[str], has_intervals: bool) -> list[layouts.Row]:
    columns = layouts.columns(metrics)
    return [
        replace(
            _layout_row(entry, columns=columns, has_intervals=has_intervals),
            method=layouts.marked(entry.method, mark_of(entry)),
        )
        for entry in board.entries
        if entry.withdrawn_at is None
    ]


def latex_row(entry: Entry) -> str:
    """One row as it stands in the LaTeX table of its board: both errors, without intervals."""
    return layouts.latex_row(_layout_row(entry, columns=layouts.columns(), has_intervals=False))


def _layout_row(entry: Entry, *, columns: Sequence[str], has_intervals: bool) -> layouts.Row:
    return layouts.Row(
        rank=_rank(entry, has_range=has_intervals),
        method=entry.method,
        team=short_authors(entry.team) if entry.kind == "published" else entry.team,
        cells=tuple(_cell(entry, name, has_interval=has_intervals) for name in columns),
    )


def _rank(entry: Entry, *, has_range: bool) -> str:
    found = entry.intervals.get("mid", Interval()) if has_range else Interval()
    return layouts.rank_text(entry.rank, low=found.rank_low, high=found.rank_high)


def _cell(entry: Entry, name: str, *, has_interval: bool) -> layouts.Cell:
    found = entry.intervals.get(name, Interval()) if has_interval else Interval()
    return layouts.Cell(
        text=format_published(entry.scores[name], decimals=entry.decimals, missing=layouts.ABSENT),
        low=format_published(found.low, decimals=entry.decimals, missing=""),
        high=format_published(found.high, decimals=entry.decimals, missing=""),
        is_best=name in entry.best,
        is_second=name in entry.second,
    )
