"""Columns of scores on every page: heads, and cells with marks and intervals."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Final

from django.utils.safestring import SafeString

from evaluator.metrics.protocol import (
    OVERALL,
    grouped_names,
    known_ranges,
    metric_of,
    range_of,
    split_name,
)
from evaluator.scoring.results import format_rounded
from leaderboard.boards.rows import ConfidenceInterval, Entry
from leaderboard.web.boards import whiskers
from leaderboard.web.boards.board_query import BoardQuery
from leaderboard.web.boards.whiskers import WhiskerScale
from leaderboard.web.formatting import interval_words

SCORED_DECIMALS: Final = 2
NOTHING: Final = SafeString("")
MARKED: Final = "may be the best of its column (95% confidence)"


@dataclass(frozen=True)
class Heading:
    """The head of a column: link to sort, and scale of its whiskers.

    `range_css` is the class of its TTC range, by which a narrow screen hides cells.
    """

    name: str
    symbol: str
    href: str
    aria_sort: str
    is_overall: bool = False
    caption: str = ""
    unit: str = ""
    spoken: str = ""
    css: str = ""
    range_css: str = ""
    metric: str = ""
    axis: SafeString = NOTHING

    @property
    def below(self) -> str:
        """Return what stands below the symbol where no group does: the unit, or of a range the metric."""
        return self.unit if self.is_overall else self.metric


@dataclass(frozen=True)
class Cell:
    """A number. `css` has the classes of its column, and aligns decimal points."""

    text: str
    css: str = ""
    range_css: str = ""  # as the heading's
    is_best: bool = False
    is_second: bool = False
    is_with_best: bool = False  # may be the best of its column: its rank range begins at 1
    interval: str = ""  # in words
    whisker: SafeString = NOTHING
    has_room: bool = False  # for a whisker: its column has one, though this value may have none

    @property
    def interval_hint(self) -> str:
        """Return the interval for hover; empty where it is not known."""
        return f"95% confidence interval: {self.interval}" if self.interval else ""

    @property
    def hint(self) -> str:
        """Return the interval and the mark for hover."""
        if not self.is_with_best:
            return self.interval_hint
        return f"{self.interval_hint}; {MARKED}" if self.interval else MARKED

    @property
    def remarks(self) -> list[str]:
        """Return what is read aloud after the number: the mark, and the interval that no whisker reads."""
        remarks = []
        if self.is_with_best:
            remarks.append(MARKED)
        if self.interval and not self.whisker:
            remarks.append(self.interval)
        return remarks

    @property
    def ends(self) -> list[str]:
        """Return both ends of the interval, for a narrow column."""
        return self.interval.split(" to ")


@dataclass(frozen=True)
class Group:
    """A metric over its columns."""

    name: str
    title: str
    symbol: str
    unit: str
    n_columns: int

    @property
    def is_narrow(self) -> bool:
        """Tell whether it has no room for its title."""
        return self.n_columns == 1

    @property
    def heading(self) -> str:
        return self.name if self.is_narrow else self.title


def ends_of(entry: Entry, name: str) -> whiskers.Ends | None:
    interval = entry.intervals.get(name, ConfidenceInterval())
    return None if interval.low is None or interval.high is None else (interval.low, interval.high)


@cache
def range_css(name: str) -> str:
    """Return the class of a score's TTC range, by its number among those of all protocols.

    >>> range_css("mid"), range_css("rte_crucial")
    ('at0', 'at1')
    """
    return f"at{(OVERALL, *known_ranges()).index(split_name(name)[1])}"


def score_groups(names: Iterable[str], *, n_whiskers: int = 0) -> tuple[Group, ...]:
    """Group scores by metric; the first has the whiskers' columns as well."""
    return tuple(
        Group(
            name=metric.title,
            title=f"{metric.title} ({metric.symbol})",
            symbol=metric.symbol,
            unit=metric.unit,
            n_columns=len(columns) + (0 if i else n_whiskers),
        )
        for i, (metric, columns) in enumerate(grouped_names(names).items())
    )


def score_heading(
    name: str, query: BoardQuery | None = None, scale: WhiskerScale | None = None, *, primary: str
) -> Heading:
    metric, ttc_range = metric_of(name), range_of(name)
    seconds = f"{ttc_range.name} {ttc_range.seconds}" if ttc_range else OVERALL
    return Heading(
        name=name,
        symbol=ttc_range.seconds if ttc_range else metric.symbol,
        is_overall=ttc_range is None,
        caption=split_name(name)[1],
        unit=metric.unit,
        spoken=f"{metric.symbol}, {seconds}",
        href=sort_href(name, query),
        aria_sort=aria_sort_of(name, query),
        css=column_css(name, primary=primary),
        range_css=range_css(name),
        metric=metric.symbol,
        axis=whiskers.axis(scale) if scale else NOTHING,
    )


def score_cells(
    entry: Entry,
    *,
    names: Iterable[str] | None = None,
    scales: Mapping[str, WhiskerScale] = MappingProxyType({}),
) -> tuple[Cell, ...]:
    cells = []
    for name in entry.scores if names is None else names:
        value, interval = entry.scores.get(name), entry.intervals.get(name, ConfidenceInterval())
        scale = scales.get(name)
        cells.append(
            Cell(
                text=format_rounded(value, decimals=entry.decimals),
                css=cell_css(name, value, entry.decimals, primary=entry.primary),
                range_css=range_css(name),
                is_best=name in entry.best,
                is_second=name in entry.second,
                is_with_best=interval.rank_low == 1,
                interval=interval_words(interval, decimals=entry.decimals),
                has_room=scale is not None,
                whisker=whiskers.whisker(scale, value, ends_of(entry, name))
                if scale and value is not None
                else NOTHING,
            )
        )
    return tuple(cells)


def column_css(name: str, *, primary: str) -> str:
    """Return the class of a score's column: the ranking one, the first of a group, or another.

    >>> [column_css(name, primary="mid") for name in ("mid", "rte", "rte_large")]
    ['primary first', 'overall first', 'wide']
    """
    if split_name(name)[1] != OVERALL:
        return "wide"
    return "primary first" if name == primary else "overall first"


def cell_css(name: str, value: float | None, decimals: int, *, primary: str) -> str:
    """Return the class of a number: its column and alignment."""
    css = column_css(name, primary=primary)
    if value is None:
        return f"{css} absent"
    return css if decimals == SCORED_DECIMALS else f"{css} d{decimals}"


def sort_href(name: str, query: BoardQuery | None) -> str:
    """Sort by this column, or reverse its order; dates begin with the newest."""
    usual, other = (f"-{name}", name) if name == "date" else (name, f"-{name}")
    if query is None:
        return ""
    return query.href(sort=other if query.sort == usual else usual)


def aria_sort_of(name: str, query: BoardQuery | None) -> str:
    if query is None or query.sort.removeprefix("-") != name:
        return ""
    return "descending" if query.sort.startswith("-") else "ascending"
