"""The tools above a board: columns, filters, search, and the number of rows."""

from collections.abc import Mapping
from datetime import date
from typing import Any, Final

from leaderboard.boards.boards import Board
from leaderboard.boards.filters import FILTERS, Filter
from leaderboard.scoring import comparisons
from leaderboard.templatetags.board import grouped
from leaderboard.web.boards.board_query import ALL_COLUMNS, BoardQuery

_SEARCH: Final = "q"


def tools(
    board: Board,
    query: BoardQuery,
    *,
    asked: Mapping[str, str],
    faults: Mapping[str, str],
    latest_day: date | None,
) -> dict[str, Any]:
    """What stands above this board: links of columns, and the form of the search and the filters.

    `asked` is the address' query, and `faults` what is wrong with it, by parameter. `latest_day` is the last
    day as of which there is a board to be asked for; None where there is no other time.
    """
    given = {name: asked.get(name, "").strip() for name in FILTERS}
    chosen = {name: each for name, each in FILTERS.items() if each.kind.options}
    typed = {name: each for name, each in FILTERS.items() if name not in chosen and name != _SEARCH}
    return {
        "columns": [
            (label, query.href(columns=value), (value or ALL_COLUMNS) == query.columns)
            for value, label in (("", "All"), *((each.name, each.symbol) for each in board.rules.metrics))
        ],
        "choosers": [
            (
                name,
                each.label,
                [(value, option.words) for option in each.kind.options for value in [option.text.lower()]],
                given[name].lower(),
                faults.get(name, ""),
            )
            for name, each in chosen.items()
        ],
        "typed": [(name, each, given[name], faults.get(name, "")) for name, each in typed.items()],
        "fault_ids": ",".join(f"#fault-{name}" for name in FILTERS),
        "text": given[_SEARCH],
        "text_fault": faults.get(_SEARCH, ""),
        "faults": [sentence for name, sentence in faults.items() if name not in FILTERS],
        "kept": query.kept("sort", "at", "columns"),
        "is_filtered": query.filters.is_set,
        "chips": chips(query),
        # Whether any filter is set, besides the text to find: else they need no room.
        "has_choices": any(text for name, text in given.items() if name != _SEARCH),
        "sentence": sentence(len(board.entries), board.n_in_all, is_filtered=query.filters.is_set),
        "clear_href": query.href(**dict.fromkeys(FILTERS, "")),
        "address": query.href(page=str(query.page) if query.page > 1 else ""),
        # Of an edition's board there is no other time.
        "latest_day": latest_day,
        "kept_but_time": query.kept("sort", "columns", *FILTERS),
        "now_href": query.href(at=""),
        "max_methods": comparisons.MAX_METHODS,
    }


def chips(query: BoardQuery) -> list[tuple[str, str]]:
    """What is set, each in words and with the address of the same view without it."""
    return [
        (f"{_label(name, each)}: {_words(each, query.given[name])}", query.href(**{name: ""}))
        for name, each in FILTERS.items()
        if name in query.filters.wanted
    ]


def _label(name: str, each: Filter) -> str:
    return "Search" if name == _SEARCH else each.label


def _words(each: Filter, text: str) -> str:
    return next((option.words for option in each.kind.options if option.text.lower() == text.lower()), text)


def sentence(n_shown: int, n_in_all: int, *, is_filtered: bool) -> str:
    """How many rows the filters let through, or how many there are.

    >>> sentence(4, 12, is_filtered=True), sentence(0, 1200, is_filtered=True)
    ('4 of 12 results', 'No results among 1,200 rows')
    >>> sentence(12, 12, is_filtered=False), sentence(1, 1, is_filtered=False)
    ('12 results', '1 result')
    """
    if not is_filtered:
        return f"{grouped(n_in_all)} result{'' if n_in_all == 1 else 's'}"
    if not n_shown:
        return f"No results among {grouped(n_in_all)} rows"
    return f"{grouped(n_shown)} of {grouped(n_in_all)} results"
