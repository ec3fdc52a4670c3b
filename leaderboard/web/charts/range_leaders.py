"""The methods that lead overall and in each TTC range of a board: a table below the chart of these errors."""

from collections.abc import Sequence
from typing import Final

from django.utils.text import get_text_list

from evaluator.counting import counted
from evaluator.metrics.protocol import OVERALL, range_of
from evaluator.scoring.results import format_rounded
from leaderboard.boards.listing import Board

# So many methods are named, if nothing else is asked for; of more, the rest is counted.
_MAX_NAMED: Final = 2


def range_leaders(board: Board) -> list[tuple[str, str, str]]:
    """Return ends with name, leading methods and lowest value, overall and of each TTC range with a value."""
    rules, rows = board.rules, []
    ranked = [entry for entry in board.entries if entry.rank is not None and entry.is_visible_to_all]
    for name in rules.names_of(rules.primary.name):
        first = [entry for entry in ranked if name in entry.best]
        if first:
            value = format_rounded(first[0].scores[name], decimals=first[0].decimals)
            rows.append((range_words(name), listed([entry.method for entry in first]), value))
    return rows


def range_words(name: str) -> str:
    """Return the ends of a score's TTC range with its name."""
    ttc_range = range_of(name)
    return f"{ttc_range.seconds} {ttc_range.name}" if ttc_range else OVERALL


def listed(names: Sequence[str], *, n_named: int = _MAX_NAMED) -> str:
    """List names in a sentence, in quotes where a comma of one would read as the end of its name.

    >>> listed(["A", "B"]), listed(["A", "B", "C"]), listed(["A, fast", "B"])
    ('A and B', 'A, B and 1 other method', '“A, fast” and “B”')
    """
    n_more = len(names) - n_named
    rest = [counted(n_more, "other method")] if n_more > 0 else []
    are_quoted = len(names) > 1 and any("," in name for name in names)
    named = [f"“{name}”" if are_quoted else name for name in names[:n_named]]
    return get_text_list([*named, *rest], "and")
