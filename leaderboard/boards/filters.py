"""Filters of a board: which rows to show, by what they state. Ranks stay those of the whole board."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from leaderboard.boards.rows import Entry
from leaderboard.methods.details import DETAILS, MAX_FILTER_TEXT, YES_NO, Detail, Kind, free_text


class BadFilter(ValueError):
    """A filter has a value that it does not take."""

    def __init__(self, field: str, given: str, expected: str) -> None:
        super().__init__(f"The filter '{field}' is {given[:60]!r}; expected {expected}.")
        self.field = field


@dataclass(frozen=True)
class Filter:
    """A filter: its kind, label, example, and the value that a row states."""

    kind: Kind
    label: str
    stated: Callable[[Entry], Any]
    example: str = ""

    def parse(self, name: str, text: str) -> Any:
        """Convert the text of a query. Raises `BadFilter`."""
        if self.kind.is_free_text and len(text) > MAX_FILTER_TEXT:
            expected = f"at most {MAX_FILTER_TEXT} characters, found {len(text)}"
            raise BadFilter(name, text, expected)
        try:
            return self.kind.wanted(text)
        except ValueError:
            raise BadFilter(name, text, self.kind.takes) from None


def _of(detail: Detail) -> Filter:
    example = detail.filter_example or str(detail.example)
    return Filter(detail.kind, detail.filter_label, lambda entry: entry.details[detail.name], example)


FILTERS: Mapping[str, Filter] = {
    **{each.filter: _of(each) for each in DETAILS if each.kind.options},
    "code": Filter(YES_NO, "Has code", lambda entry: bool(entry.code_url)),
    "paper": Filter(YES_NO, "Has paper", lambda entry: bool(entry.paper_url)),
    **{each.filter: _of(each) for each in DETAILS if not each.kind.options},
    "q": Filter(free_text(MAX_FILTER_TEXT), "Method or team contains", lambda e: f"{e.method}\n{e.team}"),
}
"""By the names in addresses, in the order of pages: first those to choose from, then those to type."""


@dataclass(frozen=True)
class Filters:
    """Values that a row must have to be shown, by filter."""

    wanted: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_set(self) -> bool:
        return bool(self.wanted)

    def admits(self, entry: Entry) -> bool:
        """Tell whether the row passes all filters, by the values that the reader sees."""
        return all(
            FILTERS[name].kind.admits(value, FILTERS[name].stated(entry))
            for name, value in self.wanted.items()
        )


def parse(query: Mapping[str, str]) -> Filters:
    """Read the filters of a query; skip empty values and other names. Raises `BadFilter`."""
    given = {name: query[name].strip() for name in FILTERS if query.get(name, "").strip()}
    return Filters({name: FILTERS[name].parse(name, text) for name, text in given.items()})
