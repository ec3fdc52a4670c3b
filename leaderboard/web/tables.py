"""The board as it is drawn: every number formatted, every mark decided, every link made, here in Python.

Templates only place what they are given; a thousand rows of number filters would cost more than the query.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from django.core.paginator import Page, Paginator
from django.utils.safestring import SafeString

from evaluator.floors import floor_sentence
from evaluator.protocol import INTERVALS, SCORE_NAMES
from evaluator.protocol import Interval as TimeInterval
from evaluator.report import format_published
from leaderboard import inference
from leaderboard.entries import Interval
from leaderboard.exports import short_authors
from leaderboard.standings import PRIMARY, Board, Entry
from leaderboard.web import drawing
from leaderboard.web.board_query import PER_PAGE, BoardQuery
from leaderboard.web.drawing import Scale

METRIC_SYMBOLS: Final = {"mid": "MiD", "rte": "RTE"}
METRIC_TITLES: Final = {"mid": "Motion-in-depth error (MiD)", "rte": "Relative TTC error (RTE)"}
METRIC_UNITS: Final = {"mid": "×10⁻⁴", "rte": "%"}
SCORED_DECIMALS: Final = 2
ABSENT: Final = "–"
NOTHING: Final = SafeString("")
MARKED: Final = "may be the best of its column at 95 %"
_INTERVALS: Final = {interval.name: interval for interval in INTERVALS}


def seconds_range(interval: TimeInterval) -> str:
    """An interval of time to contact in words of its ends.

    >>> [seconds_range(interval) for interval in INTERVALS]
    ['0–3 s', '3–6 s', '6–20 s', '−20–0 s']
    """
    return f"{interval.low_s:g}–{interval.high_s:g} s".replace("-", "−")


@dataclass(frozen=True)
class Heading:
    """A column's head: a link that sorts by it, or turns the order round; and the scale of its whiskers."""

    name: str
    symbol: str
    href: str
    aria_sort: str
    subscript: str = ""
    caption: str = ""
    unit: str = ""
    spoken: str = ""
    css: str = ""
    axis: SafeString = NOTHING


@dataclass(frozen=True)
class Cell:
    """One number. `css` says how many decimals are to be imagined behind it, so that points stand in line."""

    text: str
    css: str = ""
    is_best: bool = False
    is_second: bool = False
    is_with_best: bool = False  # may be the best of its column at 95 %: its rank range begins at 1
    interval: str = ""  # in words
    whisker: SafeString = NOTHING
    has_room: bool = False  # for a whisker: its column has one, though this value may have none

    @property
    def hint(self) -> str:
        """The interval and the mark, for whoever points at the number."""
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
class Row:
    """One entry, ready to be placed."""

    entry: Entry
    rank: str
    team: str
    cells: tuple[Cell, ...]
    rank_range: str = ""
    source_number: int | None = None
    note: str = ""  # why it stays in a former edition

    @property
    def can_be_compared(self) -> bool:
        """Whether there is something of it to be compared: papers print no values per recording."""
        return self.entry.method_id is not None and self.entry.scores["mid"] is not None


@dataclass(frozen=True)
class Source:
    """What the published rows of a board are quoted from."""

    number: int
    citation: str
    url: str


@dataclass(frozen=True)
class Group:
    """One of the two errors, over its columns."""

    title: str
    unit: str
    n_columns: int


@dataclass(frozen=True)
class IntervalFact:
    """An interval, its range and how many sequences of this edition lie in it."""

    name: str
    letter: str
    seconds: str
    n_sequences: int | None


@dataclass(frozen=True)
class BoardTable:
    """Everything that the board's template places."""

    query: BoardQuery
    text_headings: tuple[Heading, ...]
    groups: tuple[Group, ...]
    score_headings: tuple[Heading, ...]
    rows: tuple[Row, ...]
    sources: tuple[Source, ...]
    intervals: tuple[IntervalFact, ...]
    pages: "Page[Entry]"
    has_intervals: bool
    can_compare: bool
    reason: str  # why there are no intervals; empty where there are
    floor: str  # what the ground truth itself scores, in words; empty where that is not known

    @property
    def has_private_rows(self) -> bool:
        """Whether the reader's own team has rows here that nobody else sees."""
        return any(not row.entry.is_visible_to_all for row in self.rows)

    @property
    def next_href(self) -> str:
        """The next page's address; empty on the last."""
        return self._page_href(self.pages.number + 1) if self.pages.has_next() else ""

    @property
    def previous_href(self) -> str:
        """The page's before; empty on the first."""
        return self._page_href(self.pages.number - 1) if self.pages.has_previous() else ""

    def _page_href(self, number: int) -> str:
        return self.query.href(page=str(number) if number > 1 else "")


def board_table(board: Board, *, query: BoardQuery) -> BoardTable:
    """The board, ready to be drawn; its links keep what else the address asks for."""
    names = [name for name in SCORE_NAMES if name.partition("_")[0] in query.metrics]
    scales = _scales(board.entries, names if len(query.metrics) == 1 else names[:1])
    pages = Paginator(board.entries, PER_PAGE).get_page(query.page)
    sources = _sources(pages.object_list)
    numbers = {source.citation: source.number for source in sources}
    counts = board.edition.ground_truth.counts if board.edition else {}
    rows = tuple(_row(entry, names, numbers, scales) for entry in pages.object_list)
    return BoardTable(
        query=query,
        text_headings=tuple(_text_heading(name, query) for name in ("rank", "method", "team", "date")),
        groups=score_groups(query.metrics, n_whiskers=len(scales)),
        score_headings=tuple(score_heading(name, query, scales.get(name)) for name in names),
        rows=rows,
        sources=sources,
        intervals=interval_facts(counts),
        pages=pages,
        has_intervals=bool(scales),
        can_compare=_is_present(board) and sum(row.can_be_compared for row in rows) > 1,
        reason=_reason(board, has_intervals=bool(scales)),
        floor=floor_sentence(board.edition.floor, decimals=board.edition.decimals) if board.edition else "",
    )


def _is_present(board: Board) -> bool:
    return board.edition is not None and board.edition.pk == board.split.published_edition_id and not board.at


def _is_scored(entry: Entry) -> bool:
    return entry.kind == "submission" and entry.scores.get(PRIMARY) is not None


def _reason(board: Board, *, has_intervals: bool) -> str:
    """Why no value has an interval, where something was scored at all."""
    if has_intervals or board.edition is None or not any(map(_is_scored, board.entries)):
        return ""
    return inference.why_no_interval(board.edition) or (
        "The intervals are being computed; until then the values stand without them."
    )


def _scales(entries: Sequence[Entry], names: Sequence[str]) -> dict[str, Scale]:
    """One scale for each of these columns that has an interval, the same for all rows of all pages."""
    found = {}
    for name in names:
        known = [entry.intervals[name] for entry in entries if name in entry.intervals]
        ends = [end for interval in known for end in (interval.low, interval.high) if end is not None]
        values = [value for entry in entries if (value := entry.scores[name]) is not None]
        scale = drawing.scale_of([*ends, *values]) if ends else None
        if scale is not None:
            found[name] = scale
    return found


def score_groups(metrics: Sequence[str] = tuple(METRIC_TITLES), *, n_whiskers: int = 0) -> tuple[Group, ...]:
    """The errors over their columns, in the paper's order; the first has those of the whiskers besides."""
    return tuple(
        Group(
            title=METRIC_TITLES[metric],
            unit=METRIC_UNITS[metric],
            n_columns=1 + len(INTERVALS) + (n_whiskers if metric == metrics[0] else 0),
        )
        for metric in metrics
    )


def interval_facts(counts: Mapping[str, int]) -> tuple[IntervalFact, ...]:
    """The intervals in the paper's order."""
    return tuple(
        IntervalFact(
            name=interval.name,
            letter=interval.name[0],
            seconds=seconds_range(interval),
            n_sequences=counts.get(interval.name),
        )
        for interval in INTERVALS
    )


def score_heading(name: str, query: BoardQuery | None = None, scale: Scale | None = None) -> Heading:
    """The head of one of the ten numbers."""
    metric, _, interval_name = name.partition("_")
    symbol = METRIC_SYMBOLS[metric]
    interval = _INTERVALS.get(interval_name)
    spoken = f"{symbol}, {interval.name} {seconds_range(interval)}" if interval else f"{symbol}, overall"
    css = "primary" if name == "mid" else "overall" if interval is None else "wide"
    return Heading(
        name=name,
        symbol=symbol,
        subscript=interval_name[:1],
        caption=interval_name or "overall",
        unit=METRIC_UNITS[metric],
        spoken=spoken,
        href=_sort_href(name, query),
        aria_sort=_aria_sort(name, query),
        css=f"{css} first" if interval is None else css,
        axis=drawing.axis(scale) if scale else NOTHING,
    )


def score_cells(
    scores: Mapping[str, float | None],
    *,
    names: Sequence[str] = SCORE_NAMES,
    intervals: Mapping[str, Interval] = MappingProxyType({}),
    scales: Mapping[str, Scale] = MappingProxyType({}),
    decimals: int = SCORED_DECIMALS,
    best: frozenset[str] = frozenset(),
    second: frozenset[str] = frozenset(),
) -> tuple[Cell, ...]:
    """The numbers of a result in the paper's order, each with its interval where it has one."""
    cells = []
    for name in names:
        value, found = scores.get(name), intervals.get(name, Interval())
        scale = scales.get(name)
        cells.append(
            Cell(
                text=format_published(value, decimals=decimals),
                css=_cell_css(name, value, decimals),
                is_best=name in best,
                is_second=name in second,
                is_with_best=found.rank_low == 1,
                interval=interval_words(found, decimals=decimals),
                has_room=scale is not None,
                whisker=drawing.whisker(scale, value, found.low, found.high)
                if scale and value is not None
                else NOTHING,
            )
        )
    return tuple(cells)


def interval_words(found: Interval, *, decimals: int = SCORED_DECIMALS) -> str:
    """From where to where a value may lie; empty where that is not known.

    >>> interval_words(Interval(low=13.9, high=14.523)), interval_words(Interval())
    ('13.90 to 14.52', '')
    >>> interval_words(Interval(low=13.9, high=14.5), decimals=1)
    '13.9 to 14.5'
    """
    if found.low is None or found.high is None:
        return ""
    low, high = (format_published(end, decimals=decimals) for end in (found.low, found.high))
    return f"{low} to {high}"


def figure_css(texts: Iterable[str]) -> str:
    """The class that gives each of these figures the width of the widest, so that points stand in line.

    >>> figure_css(["9.36", "13.66"])
    'figure w5'
    """
    return f"figure w{max((len(text) for text in texts), default=0)}"


def rank_range(entry: Entry) -> str:
    """Where an entry may stand at 95 %, behind its rank; empty where that is not known."""
    found = entry.intervals.get("mid", Interval())
    if found.rank_low is None or found.rank_high is None:
        return ""
    if found.rank_low == found.rank_high:
        return f"({found.rank_low})"
    return f"({found.rank_low}–{found.rank_high})"


def _cell_css(name: str, value: float | None, decimals: int) -> str:
    place = {"mid": "primary first", "rte": "overall first"}.get(name, "wide")
    if value is None:
        return f"{place} absent"
    return place if decimals == SCORED_DECIMALS else f"{place} d{decimals}"


def _text_heading(name: str, query: BoardQuery) -> Heading:
    label = {"rank": "Rank", "method": "Method", "team": "Team", "date": "Date"}[name]
    return Heading(
        name=name,
        symbol=label,
        href=_sort_href(name, query),
        aria_sort=_aria_sort(name, query),
        css=f"{name} wide" if name in {"team", "date"} else name,
    )


def _sort_href(name: str, query: BoardQuery | None) -> str:
    """Sort by this column; where it decides already, turn round. Dates begin with the newest."""
    usual, other = (f"-{name}", name) if name == "date" else (name, f"-{name}")
    if query is None:
        return ""
    return query.href(sort=other if query.sort == usual else usual)


def _aria_sort(name: str, query: BoardQuery | None) -> str:
    """The attribute's value; empty for the columns that do not decide the order."""
    if query is None or query.sort.removeprefix("-") != name:
        return ""
    return "descending" if query.sort.startswith("-") else "ascending"


def _row(
    entry: Entry, names: Sequence[str], source_numbers: Mapping[str, int], scales: Mapping[str, Scale]
) -> Row:
    is_published = entry.kind == "published"
    return Row(
        entry=entry,
        rank=ABSENT if entry.rank is None else str(entry.rank),
        rank_range=rank_range(entry),
        team=short_authors(entry.team) if is_published else entry.team,
        cells=score_cells(
            entry.scores,
            names=names,
            intervals=entry.intervals,
            scales=scales,
            decimals=entry.decimals,
            best=entry.best,
            second=entry.second,
        ),
        source_number=source_numbers.get(entry.source),
    )


def _sources(entries: Iterable[Entry]) -> tuple[Source, ...]:
    urls = {entry.source: entry.paper_url for entry in entries if entry.source}
    return tuple(
        Source(number=i, citation=citation, url=urls[citation]) for i, citation in enumerate(sorted(urls), 1)
    )
