"""A board of the site as an export.

Every number is the text that the page shows; texts of teams have no power in a spreadsheet or a paper.
A row that others see differently says so in every format.
"""

from collections.abc import Sequence
from dataclasses import replace
from datetime import date
from typing import Final

from django.conf import settings

from evaluator.scoring.results import format_rounded
from evaluator.tables import formats, layouts
from evaluator.tables.formats import Format
from evaluator.tables.layouts import Export
from evaluator.units import RECORDING
from leaderboard.boards.filters import BadFilter
from leaderboard.boards.listing import Board
from leaderboard.boards.rows import ANONYMOUS_TEAM, ConfidenceInterval, Entry
from leaderboard.exports import bibtex, eval_results
from leaderboard.methods.details import DETAILS

WITH_INTERVALS: Final = {"1": True, "yes": True, "0": False, "no": False}


def is_asked_for(name: str, text: str) -> bool:
    """Tell whether a query sets this switch. Raises `filters.BadFilter`."""
    if text and text not in WITH_INTERVALS:
        raise BadFilter(name, text, f"one of {', '.join(WITH_INTERVALS)}")
    return WITH_INTERVALS.get(text, False)


def team_of(entry: Entry) -> str:
    """Return the team, or the short form of a paper's authors."""
    return layouts.short_authors(entry.team) if entry.kind == "published" else entry.team


def mark_of(entry: Entry) -> str:
    """Return the note on a row that others see differently; else empty."""
    return layouts.mark_of(visibility=entry.visibility, pseudonym=entry.pseudonym)


def offered() -> list[Format]:
    """Return what pages offer: the format of the Hugging Face Hub only if the site names a dataset there."""
    return [each for each in formats.FORMATS if each.name != "hf-eval" or eval_results.is_configured()]


# --- a board ---------------------------------------------------------------------------------------------


def export(
    board: Board,
    *,
    address: str,
    metric: str = "",
    has_intervals: bool = False,
    visited_on: date | None = None,
) -> Export:
    """Export all scores of a board, or those of one metric. `address` is permanent, `visited_on` today."""
    scores, names = board.rules.names_of(metric), board.rules.score_names
    return Export(
        origin=_origin(board, address=address),
        scores=scores,
        rows=(
            replace(
                _layout_row(entry, columns=scores, has_intervals=has_intervals),
                method=layouts.marked(entry.method, mark_of(entry)),
            )
            for entry in board.entries
            if entry.withdrawn_at is None
        ),
        columns=(
            *("rank", "rank_low", "rank_high", "kind", "method", "team", "date"),
            *names,
            *("n_attempts", *(detail.name for detail in DETAILS)),
            *("description", "paper_url", "code_url", "source"),
            *("method_id", "withdrawn_at", "visibility"),
            *(f"{name}_{end}" for name in names if has_intervals for end in ("low", "high")),
        ),
        records=(_csv_row(entry, has_intervals=has_intervals) for entry in board.entries),
        references=bibtex.references(
            board.entries,
            of_board=bibtex.of_edition(
                board.edition, address=address, at=board.at or board.updated_at, visited_on=visited_on
            )
            if board.edition
            else "",
        ),
        eval_results=eval_results.lines(board.entries, edition=board.edition),
    )


def _origin(board: Board, *, address: str) -> layouts.Origin:
    edition = board.edition
    truth = edition.ground_truth if edition else None
    return layouts.Origin(
        site=settings.BENCHMARK.site_name,
        split=board.split.pk,
        address=address,
        edition=edition.number if edition else None,
        protocol=edition.protocol if edition else None,
        ground_truth=truth.digest if truth else None,
        n_sequences=truth.n_sequences if truth else None,
        n_recordings=truth.n_recordings if truth else None,
        unit=edition.unit if edition else RECORDING,
        n_units=edition.unit_count if edition else None,
        moment=board.at or board.updated_at,
        has_own_rows=any(mark_of(entry) for entry in board.entries if entry.withdrawn_at is None),
    )


def _csv_row(entry: Entry, *, has_intervals: bool) -> dict[str, object]:
    ranks = entry.interval
    row: dict[str, object] = {
        "rank": entry.rank,
        "rank_low": ranks.rank_low,
        "rank_high": ranks.rank_high,
        **{name: getattr(entry, name) for name in ("kind", "method", "team", "n_attempts")},
        "date": entry.date_text,
        **{
            name: format_rounded(value, decimals=entry.decimals, missing="")
            for name, value in entry.scores.items()
        },
        **entry.details,
        **{name: getattr(entry, name) for name in ("description", "paper_url", "code_url", "source")},
        "method_id": entry.method_id,
        "withdrawn_at": entry.withdrawn_at.isoformat() if entry.withdrawn_at else None,
        "visibility": entry.visibility,
    }
    if has_intervals:
        for name in entry.scores:
            interval = entry.intervals.get(name, ConfidenceInterval())
            row[f"{name}_low"] = format_rounded(interval.low, decimals=entry.decimals, missing="")
            row[f"{name}_high"] = format_rounded(interval.high, decimals=entry.decimals, missing="")
    return row


def as_printed(entry: Entry) -> Entry:
    """Return the row for a paper, which under double-blind review must name no anonymous method's team."""
    return replace(entry, method=entry.pseudonym, team=ANONYMOUS_TEAM) if entry.pseudonym else entry


def latex_row(entry: Entry, *, has_intervals: bool = False) -> str:
    """Make one row of the LaTeX table, as printed: all scores, with or without intervals."""
    row = _layout_row(as_printed(entry), columns=tuple(entry.scores), has_intervals=has_intervals)
    return layouts.latex_row(row)


def _layout_row(entry: Entry, *, columns: Sequence[str], has_intervals: bool) -> layouts.Row:
    ranks = entry.interval if has_intervals else ConfidenceInterval()
    return layouts.Row(
        rank=layouts.rank_text(entry.rank, low=ranks.rank_low, high=ranks.rank_high),
        method=entry.method,
        team=team_of(entry),
        cells=tuple(_cell(entry, name, has_interval=has_intervals) for name in columns),
    )


def _cell(entry: Entry, name: str, *, has_interval: bool) -> layouts.Cell:
    interval = entry.intervals.get(name, ConfidenceInterval()) if has_interval else ConfidenceInterval()
    return layouts.Cell(
        text=format_rounded(entry.scores[name], decimals=entry.decimals, missing=layouts.ABSENT),
        low=format_rounded(interval.low, decimals=entry.decimals, missing=""),
        high=format_rounded(interval.high, decimals=entry.decimals, missing=""),
        is_best=name in entry.best,
        is_second=name in entry.second,
    )
