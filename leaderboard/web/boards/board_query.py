"""The query of a board's address: order, time, columns, filters, page."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import date, datetime
from typing import Any, Final
from urllib.parse import urlencode

from evaluator.counting import counted
from evaluator.metrics.protocol import known_metrics
from leaderboard.boards import filters, listing
from leaderboard.boards.filters import FILTERS, Filter, Filters
from leaderboard.boards.listing import Board
from leaderboard.statistics import comparisons
from leaderboard.web.formatting import grouped

PER_PAGE: Final = 100
MANY: Final = 10  # rows, from which on a search saves time
ALL_COLUMNS: Final = "both"
NAMES: Final = ("at", "sort", "columns", *filters.FILTERS, "page")
"""The parameters that a view of a board reads from its address."""
_MAX_PAGE_DIGITS: Final = 6


class BadView(ValueError):
    """A query with impossible columns or page. `field` is the parameter's name."""

    def __init__(self, field: str, sentence: str, *, on_page: str = "") -> None:
        super().__init__(sentence)
        self.field = field
        self.on_page = on_page or sentence


# What is wrong with an address; each is a sentence for the reader.
FAULTS: Final = (listing.UnknownColumn, listing.BadTime, filters.BadFilter, BadView)


@dataclass(frozen=True)
class BoardQuery:
    """A view of a board. `given` has the parameters of the address, for links that keep them."""

    sort: str = "rank"
    at: datetime | None = None
    columns: str = ALL_COLUMNS
    page: int = 1
    filters: Filters = field(default_factory=Filters)
    given: Mapping[str, str] = field(default_factory=dict)

    def href(self, **changes: str) -> str:
        """Return the address of this view with changes (empty: left out), from its first page.

        >>> BoardQuery(given={"sort": "mid", "nerf": "no", "page": "2"}).href(sort="-mid")
        '?sort=-mid&nerf=no'
        """
        wanted = {**self.given, "page": "", **changes}
        return "?" + urlencode({name: wanted[name] for name in NAMES if wanted.get(name)})

    def kept(self, *names: str) -> tuple[tuple[str, str], ...]:
        """Return the parameters that a form for the others must send along."""
        return tuple((name, self.given[name]) for name in names if name in self.given)


def forgiving(
    query: Mapping[str, str], *, now: datetime, has_time: bool = True
) -> tuple[BoardQuery, dict[str, str]]:
    """Parse a query without its faults; return a sentence for a visitor on each of them as well."""
    left, faults = {name: query[name] for name in query}, dict[str, str]()
    while True:
        try:
            return parse(left, now=now, has_time=has_time), faults
        except FAULTS as fault:
            faults[fault.field] = on_page(fault)
            del left[fault.field]


def on_page(fault: Exception) -> str:
    """Say what is wrong with an address, to a person; programs get the whole list of what is right."""
    return getattr(fault, "on_page", str(fault))


def parse(query: Mapping[str, str], *, now: datetime, has_time: bool = True) -> BoardQuery:
    """Parse a query; ignore other parameters. Raises one of `FAULTS`.

    `has_time` is False for the board of an edition.
    """
    given = {name: query[name].strip() for name in NAMES if query.get(name, "").strip()}
    at = listing.parse_time(given["at"]) if has_time and "at" in given else None
    if at is None:
        given.pop("at", None)
    sort = given.get("sort", "rank")
    listing.require_column(sort)
    return BoardQuery(
        sort=sort,
        at=at if at and at < now else None,  # what has not come yet is as it is now
        columns=_columns(given.get("columns", ALL_COLUMNS)),
        page=_page(given.get("page", "1")),
        filters=filters.parse(given),
        given=given,
    )


def _columns(text: str) -> str:
    known = (ALL_COLUMNS, *known_metrics())
    if text not in known:
        raise BadView(
            "columns",
            f"The board has no columns {text[:60]!r}; expected one of {', '.join(known)}.",
            on_page=f"This address asks for unknown columns, “{text[:60]}”. The board shows all columns.",
        )
    return text


def _page(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) <= _MAX_PAGE_DIGITS and int(text) > 0):
        raise BadView("page", f"The board has no page {text[:60]!r}; expected a number from 1 on.")
    return int(text)


_SEARCH: Final = "q"


def tools(
    board: Board,
    query: BoardQuery,
    *,
    asked: Mapping[str, str],
    faults: Mapping[str, str],
    latest_day: date | None,
) -> dict[str, Any]:
    """Return the links of columns, and the form of search and filters.

    `faults` are by parameter. `latest_day` is the last day with a board of the past, if any.
    """
    given = {name: asked.get(name, "").strip() for name in FILTERS}
    fields = [
        {
            "name": name,
            "filter": each,
            "given": given[name],
            "fault": faults.get(name, ""),
            "choices": _choices(each, given[name]),
        }
        for name, each in FILTERS.items()
        if name != _SEARCH
    ]
    return {
        "columns": [
            (label, query.href(columns=value), (value or ALL_COLUMNS) == query.columns)
            for value, label in (("", "All"), *((each.name, each.symbol) for each in board.rules.metrics))
        ],
        # What is chosen from a list comes before what is typed.
        "fields": sorted(fields, key=lambda field: not field["choices"]),
        "fault_ids": ",".join(f"#fault-{name}" for name in FILTERS),
        "text": given[_SEARCH],
        "text_fault": faults.get(_SEARCH, ""),
        "faults": [sentence for name, sentence in faults.items() if name not in FILTERS],
        "kept": query.kept("sort", "at", "columns"),
        "is_filtered": query.filters.is_set,
        "has_finder": board.n_in_all >= MANY or bool(asked.keys() & FILTERS.keys()),
        "chips": [
            (f"{label}: {_words(name, query.given[name])}", query.href(**{name: ""}))
            for name, each in FILTERS.items()
            if name in query.filters.wanted
            for label in ["Search" if name == _SEARCH else each.label]
        ],
        # The panel of filters is open only for a fault in it: chips name what is set.
        "has_fault": any(field["fault"] for field in fields),
        "ignored": [each.label for name, each in FILTERS.items() if name != _SEARCH and faults.get(name)],
        "has_choices": any(text for name, text in given.items() if name != _SEARCH),
        "sentence": sentence(board, is_filtered=query.filters.is_set),
        "clear_href": query.href(**dict.fromkeys(FILTERS, "")),
        "address": query.href(page=str(query.page) if query.page > 1 else "").removesuffix("?"),
        # Of an edition's board there is no other time.
        "latest_day": latest_day,
        "kept_but_time": query.kept("sort", "columns", *FILTERS),
        "now_href": query.href(at=""),
        "max_methods": comparisons.MAX_METHODS,
    }


def _choices(each: Filter, given: str) -> list[tuple[str, str, bool]]:
    """Return value, words and whether it is chosen, of each option of a filter; none where one types."""
    texts = [(option.text.lower(), option.words) for option in each.kind.options]
    return [(text, words, text == given.lower()) for text, words in texts]


def _words(name: str, text: str) -> str:
    options = FILTERS[name].kind.options
    return next((option.words for option in options if option.text.lower() == text.lower()), text)


def sentence(board: Board, *, is_filtered: bool) -> str:
    """Count the rows shown and in all, private ones apart: they have no place among the ranks."""
    if is_filtered:
        return f"{grouped(len(board.entries))} of {counted(board.n_in_all, 'result')}"
    n_private = sum(not entry.is_visible_to_all for entry in board.entries)
    results = counted(board.n_in_all - n_private, "result")
    return f"{results} and {grouped(n_private)} private" if n_private else results
