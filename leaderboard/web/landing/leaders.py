"""The first rows of a board, whether the lead is significant, and who leads in each TTC range."""

from collections.abc import Sequence
from typing import Any, Final

from django.utils.text import get_text_list

from evaluator.counting import counted
from evaluator.metrics.protocol import range_of
from evaluator.scoring.results import format_rounded
from leaderboard.boards.listing import Board
from leaderboard.boards.rows import Entry
from leaderboard.exports.tables import team_of
from leaderboard.statistics import confidence
from leaderboard.web.boards.tables import rank_range
from leaderboard.web.formatting import interval_words

N_LEADERS: Final = 3
# So many methods are named; of more, the rest is counted.
_MAX_NAMED: Final = 2


def leaders(board: Board) -> list[dict[str, Any]]:
    return [
        {
            "entry": entry,
            "team": team_of(entry),
            "value": format_rounded(entry.value, decimals=entry.decimals),
            "interval": interval_words(entry.interval, decimals=entry.decimals),
            "rank_range": rank_range(entry).strip("()"),
        }
        for entry in _ranked(board)[:N_LEADERS]
    ]


def range_leaders(board: Board) -> list[tuple[str, str, str]]:
    """Return ends, leading methods and lowest value of each TTC range that has a value."""
    rules, rows = board.rules, []
    for name in rules.names_of(rules.primary.name):
        first = [entry for entry in _ranked(board) if name in entry.best]
        ttc_range = range_of(name)
        if ttc_range is not None and first:
            value = format_rounded(first[0].scores[name], decimals=first[0].decimals)
            rows.append((ttc_range.seconds, _listed([entry.method for entry in first]), value))
    return rows


def _ranked(board: Board) -> list[Entry]:
    return [entry for entry in board.entries if entry.rank is not None]


def lead_words(board: Board) -> str:
    """Say whether the lead is significant, by 95% rank ranges; empty for fewer than two rows."""
    ranked = _ranked(board)
    first = [entry for entry in ranked if entry.rank == 1]
    if len(ranked) < 2:
        return ""
    if len(first) > 1:
        return f"{_listed([entry.method for entry in first])} share the first rank."
    (leader,) = first
    interval = leader.interval
    if interval.rank_low is None or interval.rank_high is None:
        return f"Whether the lead is significant is not known: {_why_unknown(board, leader)}"
    if interval.rank_high == 1:
        return f"The lead of {leader.method} is significant (95% confidence)."
    also = [e.method for e in ranked[1:] if e.interval.rank_low == 1]
    others = f" {_listed(also)} may also be first." if also else ""
    return (
        f"The lead of {leader.method} is not significant: with 95% confidence its rank is "
        f"{interval.rank_low} to {interval.rank_high}.{others}"
    )


def _why_unknown(board: Board, leader: Entry) -> str:
    if leader.kind == "published":
        return "papers report no values per recording."
    reason = confidence.why_no_interval(board.edition) if board.edition else ""
    # As the end of a sentence.
    return f"{reason[:1].lower()}{reason[1:]}" or "the confidence intervals are being computed."


def _listed(names: Sequence[str]) -> str:
    """List names in a sentence.

    >>> _listed(["A", "B"]), _listed(["A", "B", "C"])
    ('A and B', 'A, B and 1 other method')
    """
    n_more = len(names) - _MAX_NAMED
    rest = [counted(n_more, "other method")] if n_more > 0 else []
    return get_text_list([*names[:_MAX_NAMED], *rest], "and")
