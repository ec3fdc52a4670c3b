"""The methods that lead in each TTC range of a board: a table below the chart of these errors."""

from collections.abc import Sequence
from typing import Final

from django.utils.text import get_text_list

from evaluator.counting import counted
from evaluator.metrics.protocol import range_of
from evaluator.scoring.results import format_rounded
from leaderboard.boards.listing import Board

# So many methods are named; of more, the rest is counted.
_MAX_NAMED: Final = 2


def range_leaders(board: Board) -> list[tuple[str, str, str]]:
    """Return ends with name, leading methods and lowest value of each TTC range that has a value."""
    rules, rows = board.rules, []
    ranked = [entry for entry in board.entries if entry.rank is not None and entry.is_visible_to_all]
    for name in rules.names_of(rules.primary.name):
        first = [entry for entry in ranked if name in entry.best]
        ttc_range = range_of(name)
        if ttc_range is not None and first:
            value = format_rounded(first[0].scores[name], decimals=first[0].decimals)
            rows.append(
                (f"{ttc_range.seconds} {ttc_range.name}", listed([entry.method for entry in first]), value)
            )
    return rows


def listed(names: Sequence[str]) -> str:
    """List names in a sentence.

    >>> listed(["A", "B"]), listed(["A", "B", "C"])
    ('A and B', 'A, B and 1 other method')
    """
    n_more = len(names) - _MAX_NAMED
    rest = [counted(n_more, "other method")] if n_more > 0 else []
    return get_text_list([*names[:_MAX_NAMED], *rest], "and")
