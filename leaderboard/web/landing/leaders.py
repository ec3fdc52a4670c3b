"""The first rows of a board, and whether the lead is significant."""

from typing import Any, Final

from evaluator.scoring.results import format_rounded
from leaderboard.boards.listing import Board
from leaderboard.boards.rows import Entry
from leaderboard.exports.tables import team_of
from leaderboard.statistics import confidence
from leaderboard.web.boards.tables import rank_range
from leaderboard.web.charts.range_leaders import listed
from leaderboard.web.formatting import interval_words

N_LEADERS: Final = 3


def leaders(board: Board) -> list[dict[str, Any]]:
    return [
        {
            "entry": entry,
            "team": team_of(entry),
            "value": format_rounded(entry.value, decimals=entry.decimals),
            "notes": _notes(entry),
        }
        for entry in _ranked(board)[:N_LEADERS]
    ]


def _notes(entry: Entry) -> list[str]:
    """Say how sure value and rank are; nothing of a published row without an interval."""
    notes = []
    interval = interval_words(entry.interval, decimals=entry.decimals)
    if interval:
        notes.append(f"95% CI {interval}")
    elif entry.kind != "published":
        notes.append("no confidence interval")
    ranks = rank_range(entry).strip("()")
    if ranks:
        notes.append(f"rank range {ranks}")
    return notes


def _ranked(board: Board) -> list[Entry]:
    return [entry for entry in board.entries if entry.rank is not None]


def lead_words(board: Board) -> str:
    """Say whether the lead is significant, by 95% rank ranges; empty for fewer than two rows."""
    ranked = _ranked(board)
    first = [entry for entry in ranked if entry.rank == 1]
    if len(ranked) < 2:
        return ""
    if len(first) > 1:
        return f"{listed([entry.method for entry in first])} share the first rank."
    (leader,) = first
    interval = leader.interval
    if interval.rank_low is None or interval.rank_high is None:
        return f"We cannot tell whether the lead is significant: {_why_unknown(board, leader)}"
    if interval.rank_high == 1:
        return f"The lead of {leader.method} is significant (95% confidence)."
    also = [e.method for e in ranked[1:] if e.interval.rank_low == 1]
    others = f" {listed(also)} may also be first." if also else ""
    return (
        f"The lead of {leader.method} is not significant: with 95% confidence its rank is "
        f"{interval.rank_low} to {interval.rank_high}.{others}"
    )


def _why_unknown(board: Board, leader: Entry) -> str:
    if leader.kind == "published":
        return "the paper reports no values per recording."
    reason = confidence.why_no_interval(board.edition) if board.edition else ""
    # As the end of a sentence.
    return f"{reason[:1].lower()}{reason[1:]}" or "the confidence intervals are being computed."
