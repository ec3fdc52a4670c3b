"""Columns of scores on every page: their heads, and the cells with their marks and intervals."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Final

from django.utils.safestring import SafeString

from evaluator.metrics.protocol import (
    OVERALL,
    PRIMARY,
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

SCORED_DECIMALS: Final = 2
NOTHING: Final = SafeString("")
MARKED: Final = "statistically tied for best in its column (95 % confidence)"


@dataclass(frozen=True)
class Heading:
    """A column's head: a link that sorts by it, or turns the order round; and the scale of its whiskers.

    `range_css` is the class of all cells of its TTC range, by which a narrow screen chooses what it shows.
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


@dataclass(frozen=True)
class Cell:
    """One number. `css` says how many decimals are to be imagined behind it, so that points stand in line."""

    text: str
    css: str = ""
    range_css: str = ""  # as the heading's
    is_best: bool = False
    is_second: bool = False
    is_with_best: bool = (
        False  # statistically tied for best in its column (95 % confidence): its rank range begins at 1
    )
    interval: str = ""  # in words
    whisker: SafeString = NOTHING
    has_room: bool = False  # for a whisker: its column has one, though this value may have none

    @property
    def hint(self) -> str:
        """The interval and the mark, shown when the pointer is on the number."""
        hints = (
            f"95 % confidence interval: {self.interval}" if self.interval else "",
            MARKED * self.is_with_best,
        )
        return "; ".join(filter(None, hints))

    @property
    def ends(self) -> list[str]:
        """Both ends of the interval, for a column too narrow to have them side by side."""
        return self.interval.split(" to ")


@dataclass(frozen=True)
class Group:
    """One of the metrics, over its columns."""

    title: str
    unit: str
    n_columns: int


def ends_of(entry: Entry, name: str) -> whiskers.Ends | None:
    interval = entry.intervals.get(name, ConfidenceInterval())
    return None if interval.low is None or interval.high is None else (interval.low, interval.high)


@cache
def range_css(name: str) -> str:
    """The class of all columns of a score's TTC range, by its number among the ranges of all protocols.

    >>> range_css("mid"), range_css("rte_crucial")
    ('at0', 'at1')
    """
    return f"at{(OVERALL, *known_ranges()).index(split_name(name)[1])}"


def score_groups(names: Iterable[str], *, n_whiskers: int = 0) -> tuple[Group, ...]:
    """The metrics of these scores over their columns; the first has those of the whiskers besides."""
    return tuple(
        Group(
            title=f"{metric.title} ({metric.symbol})",
            unit=metric.unit,
            n_columns=len(columns) + (0 if i else n_whiskers),
        )
        for i, (metric, columns) in enumerate(grouped_names(names).items())
    )


def score_heading(name: str, query: BoardQuery | None = None, scale: WhiskerScale | None = None) -> Heading:
    """The head of a score's column."""
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
        css=column_css(name),
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
    """The numbers of a result, all or those of these names, each with its interval where it has one."""
    cells = []
    for name in entry.scores if names is None else names:
        value, interval = entry.scores.get(name), entry.intervals.get(name, ConfidenceInterval())
        scale = scales.get(name)
        cells.append(
            Cell(
                text=format_rounded(value, decimals=entry.decimals),
                css=cell_css(name, value, entry.decimals),
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


def interval_words(interval: ConfidenceInterval, *, decimals: int = SCORED_DECIMALS) -> str:
    """Return an interval in words; empty where it is not known.

    >>> interval_words(ConfidenceInterval(low=13.9, high=14.523)), interval_words(ConfidenceInterval())
    ('13.90 to 14.52', '')
    >>> interval_words(ConfidenceInterval(low=13.9, high=14.5), decimals=1)
    '13.9 to 14.5'
    """
    if interval.low is None or interval.high is None:
        return ""
    low, high = (format_rounded(end, decimals=decimals) for end in (interval.low, interval.high))
    return f"{low} to {high}"


def figure_css(texts: Iterable[str]) -> str:
    """The class that gives each of these figures the width of the widest, so that points stand in line.

    >>> figure_css(["9.36", "13.66"])
    'figure w5'
    """
    return f"figure w{max((len(text) for text in texts), default=0)}"


def column_css(name: str) -> str:
    """The class of a score's column: the one that ranks, one that begins a group, or one of the others.

    >>> column_css("mid"), column_css("rte"), column_css("rte_large")
    ('primary first', 'overall first', 'wide')
    """
    if split_name(name)[1] != OVERALL:
        return "wide"
    return "primary first" if name == PRIMARY else "overall first"


def cell_css(name: str, value: float | None, decimals: int) -> str:
    """The class of a number: its column, and what keeps its point in line."""
    css = column_css(name)
    if value is None:
        return f"{css} absent"
    return css if decimals == SCORED_DECIMALS else f"{css} d{decimals}"


def sort_href(name: str, query: BoardQuery | None) -> str:
    """Sort by this column; where it decides already, turn round. Dates begin with the newest."""
    usual, other = (f"-{name}", name) if name == "date" else (name, f"-{name}")
    if query is None:
        return ""
    return query.href(sort=other if query.sort == usual else usual)


def aria_sort_of(name: str, query: BoardQuery | None) -> str:
    """The attribute's value; empty for the columns that do not decide the order."""
    if query is None or query.sort.removeprefix("-") != name:
        return ""
    return "descending" if query.sort.startswith("-") else "ascending"
