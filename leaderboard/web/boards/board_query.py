"""The query of a board's address: order, time, columns, filters, page."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Final
from urllib.parse import urlencode

from evaluator.metrics.protocol import known_metrics
from leaderboard.boards import boards, filters
from leaderboard.boards.filters import Filters
from leaderboard.http import A_PAST_DAY, Parameters, one_of

PER_PAGE: Final = 100
ALL_COLUMNS: Final = "both"
_NAMES: Final = ("at", "sort", "columns", *filters.FILTERS, "page")
_MAX_PAGE_DIGITS: Final = 6
PARAMETERS: Final[Parameters] = {
    "at": A_PAST_DAY,
    "sort": one_of("", *boards.SORTS),
    "columns": one_of("", ALL_COLUMNS, *known_metrics()),
    **filters.PARAMETERS,
    "page": one_of("", *map(str, range(1, 51))),
}
"""What a view of a board reads of its address."""


class BadView(ValueError):
    """The address asks for columns or a page that there cannot be. `field` is the parameter's name."""

    def __init__(self, field: str, sentence: str) -> None:
        super().__init__(sentence)
        self.field = field


# What is wrong with an address; each is a sentence for the reader.
FAULTS: Final = (boards.UnknownColumn, boards.BadTime, filters.BadFilter, BadView)


@dataclass(frozen=True)
class BoardQuery:
    """One view of a board. `given` is what the address names, for links that keep it."""

    sort: str = "rank"
    at: datetime | None = None
    columns: str = ALL_COLUMNS
    page: int = 1
    filters: Filters = field(default_factory=Filters)
    given: Mapping[str, str] = field(default_factory=dict)

    def href(self, **changes: str) -> str:
        """The address of the same view, with these changes (empty: left out), from its first page.

        >>> BoardQuery(given={"sort": "mid", "nerf": "no", "page": "2"}).href(sort="-mid")
        '?sort=-mid&nerf=no'
        """
        wanted = {**self.given, "page": "", **changes}
        return "?" + urlencode({name: wanted[name] for name in _NAMES if wanted.get(name)})

    def kept(self, *names: str) -> tuple[tuple[str, str], ...]:
        """What a form that asks for the rest has to send along."""
        return tuple((name, self.given[name]) for name in names if name in self.given)


def forgiving(
    query: Mapping[str, str], *, now: datetime, has_time: bool = True
) -> tuple[BoardQuery, dict[str, str]]:
    """The view that an address asks for but for what it gets wrong, and a sentence for each of these."""
    left, faults = {name: query[name] for name in query}, dict[str, str]()
    while True:
        try:
            return parse(left, now=now, has_time=has_time), faults
        except FAULTS as fault:
            faults[fault.field] = str(fault)
            del left[fault.field]


def parse(query: Mapping[str, str], *, now: datetime, has_time: bool = True) -> BoardQuery:
    """The view that an address asks for; what it names beside is not looked at.

    `has_time` is False for the board of an edition, which is as it is. Raises one of `FAULTS`.
    """
    given = {name: query[name].strip() for name in _NAMES if query.get(name, "").strip()}
    at = boards.parse_time(given["at"]) if has_time and "at" in given else None
    if at is None:
        given.pop("at", None)
    sort = given.get("sort", "rank")
    boards.require_column(sort)
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
            "columns", f"The board has no columns {text[:60]!r}; expected one of {', '.join(known)}."
        )
    return text


def _page(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) <= _MAX_PAGE_DIGITS and int(text) > 0):
        raise BadView("page", f"The board has no page {text[:60]!r}; expected a number from 1 on.")
    return int(text)
