"""What the address of a board asks for: order, time, columns, filters, page: all of a view."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Final
from urllib.parse import urlencode

from leaderboard import filters, standings
from leaderboard.filters import Filters
from leaderboard.keeping import NEVER, Parameters, one_of

PER_PAGE: Final = 100
COLUMNS: Final[Mapping[str, tuple[str, ...]]] = {"both": ("mid", "rte"), "mid": ("mid",), "rte": ("rte",)}
_NAMES: Final = ("at", "sort", "columns", *filters.NAMES, "page")
_MAX_PAGE_DIGITS: Final = 6
PARAMETERS: Final[Parameters] = {
    "at": NEVER,
    "sort": one_of("", *standings.SORTS),
    "columns": one_of("", *COLUMNS),
    **filters.PARAMETERS,
    "page": one_of("", *map(str, range(1, 51))),
}
"""What a view of a board reads of its address."""


class BadView(ValueError):
    """The address asks for columns or a page that there cannot be."""


# What is wrong with an address; each is a sentence for the reader.
FAULTS: Final = (standings.UnknownColumn, standings.BadMoment, filters.BadFilter, BadView)


@dataclass(frozen=True)
class BoardQuery:
    """One view of a board. `given` is what the address names, for links that keep it."""

    sort: str = "rank"
    at: datetime | None = None
    columns: str = "both"
    page: int = 1
    filters: Filters = field(default_factory=Filters)
    given: Mapping[str, str] = field(default_factory=dict)

    @property
    def metrics(self) -> tuple[str, ...]:
        """The errors whose columns are shown."""
        return COLUMNS[self.columns]

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


def parse(query: Mapping[str, str], *, now: datetime, has_time: bool = True) -> BoardQuery:
    """The view that an address asks for; what it names beside is not looked at.

    `has_time` is False for the board of an edition, which is as it is. Raises one of `FAULTS`.
    """
    given = {name: query[name].strip() for name in _NAMES if query.get(name, "").strip()}
    at = standings.parse_moment(query["at"]) if has_time and "at" in query else None
    if at is None:
        given.pop("at", None)
    sort = given.get("sort", "rank")
    standings.require_column(sort)
    return BoardQuery(
        sort=sort,
        at=at if at and at < now else None,  # what has not come yet is as it is now
        columns=_columns(given.get("columns", "both")),
        page=_page(given.get("page", "1")),
        filters=filters.parse(given),
        given=given,
    )


def _columns(text: str) -> str:
    if text not in COLUMNS:
        raise BadView(f"The board has no columns {text[:60]!r}; expected one of {', '.join(COLUMNS)}.")
    return text


def _page(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) <= _MAX_PAGE_DIGITS and int(text) > 0):
        raise BadView(f"The board has no page {text[:60]!r}; expected a number from 1 on.")
    return int(text)
