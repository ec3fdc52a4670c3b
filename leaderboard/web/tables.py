"""The board as it is drawn: every number formatted, every mark decided, every link made, here in Python.

Templates only place what they are given; a thousand rows of number filters would cost more than the query.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final
from urllib.parse import urlencode

from evaluator.protocol import INTERVALS, SCORE_NAMES, Interval
from evaluator.report import format_published
from leaderboard.methods import Result
from leaderboard.models import Status, Submission
from leaderboard.standings import Board, Entry, flat_scores
from leaderboard.submissions import evaluation_of
from leaderboard.templatetags.board import grouped

METRIC_SYMBOLS: Final = {"mid": "MiD", "rte": "RTE"}
METRIC_TITLES: Final = {"mid": "Motion-in-depth error (MiD)", "rte": "Relative TTC error (RTE)"}
METRIC_UNITS: Final = {"mid": "×10⁻⁴", "rte": "%"}
SCORED_DECIMALS: Final = 2
ABSENT: Final = "–"
_INTERVALS: Final = {interval.name: interval for interval in INTERVALS}


def printed_decimals(values: Iterable[float | None]) -> int:
    """With how many decimals a row was printed: one, or two where any of its values has two.

    >>> printed_decimals([14.8, 55.0]), printed_decimals([14.82, 55.0])
    (1, 2)
    """
    known = [value for value in values if value is not None]
    return 1 if all(round(value, 1) == value for value in known) else SCORED_DECIMALS


def short_authors(authors: str) -> str:
    """Authors as a table has room for them.

    >>> short_authors("Yuheng Shi, Zehao Huang, Yan Yan")
    'Shi et al.'
    >>> short_authors("Ada Lovelace, Charles Babbage"), short_authors("Ada Lovelace")
    ('Lovelace and Babbage', 'Ada Lovelace')
    """
    names = [name.strip() for name in authors.split(",") if name.strip()]
    if len(names) < 2:
        return authors
    surnames = [name.split()[-1] for name in names]
    return " and ".join(surnames) if len(names) == 2 else f"{surnames[0]} et al."


def seconds_range(interval: Interval) -> str:
    """An interval of time to contact in words of its ends.

    >>> [seconds_range(interval) for interval in INTERVALS]
    ['0–3 s', '3–6 s', '6–20 s', '−20–0 s']
    """
    return f"{interval.low_s:g}–{interval.high_s:g} s".replace("-", "−")


@dataclass(frozen=True)
class Heading:
    """A column's head: a link that sorts by it, or turns the order round."""

    name: str
    symbol: str
    href: str
    aria_sort: str
    subscript: str = ""
    caption: str = ""
    unit: str = ""
    spoken: str = ""
    css: str = ""


@dataclass(frozen=True)
class Cell:
    """One number. `css` says how many decimals are to be imagined behind it, so that points stand in line."""

    text: str
    css: str = ""
    is_best: bool = False
    is_second: bool = False


@dataclass(frozen=True)
class Row:
    """One entry, ready to be placed."""

    entry: Entry
    rank: str
    team: str
    cells: tuple[Cell, ...]
    source_number: int | None = None
    note: str = ""  # why it stays in a former edition


@dataclass(frozen=True)
class Source:
    """What the published rows of a board are quoted from."""

    number: int
    citation: str
    url: str


@dataclass(frozen=True)
class Group:
    """One of the two errors, over its five columns."""

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

    text_headings: tuple[Heading, ...]
    groups: tuple[Group, ...]
    score_headings: tuple[Heading, ...]
    rows: tuple[Row, ...]
    sources: tuple[Source, ...]
    intervals: tuple[IntervalFact, ...]


@dataclass(frozen=True)
class ResultGroup:
    """One of the two errors of one result: five heads, five values, five counts."""

    group: Group
    columns: tuple[tuple[Heading, Cell, str], ...]


@dataclass(frozen=True)
class MethodResult:
    """What a method achieved on a split, ready to be placed."""

    result: Result
    groups: tuple[ResultGroup, ...]


def board_table(board: Board, *, query: Mapping[str, str]) -> BoardTable:
    """The board, ready to be drawn; its links keep what else the address asks for."""
    kept = {name: value for name, value in query.items() if name != "sort"}
    sources = _sources(board.entries)
    numbers = {source.citation: source.number for source in sources}
    counts = board.edition.ground_truth.counts if board.edition else {}
    return BoardTable(
        text_headings=tuple(
            _text_heading(name, board.sort, kept) for name in ("rank", "method", "team", "date")
        ),
        groups=score_groups(),
        score_headings=tuple(score_heading(name, board.sort, kept) for name in SCORE_NAMES),
        rows=tuple(_row(entry, numbers) for entry in board.entries),
        sources=sources,
        intervals=interval_facts(counts),
    )


def score_groups() -> tuple[Group, ...]:
    """The two errors over their columns, in the paper's order."""
    return tuple(
        Group(title=title, unit=METRIC_UNITS[metric], n_columns=1 + len(INTERVALS))
        for metric, title in METRIC_TITLES.items()
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


def score_heading(name: str, sort: str = "", kept: Mapping[str, str] = MappingProxyType({})) -> Heading:
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
        href=_sort_href(name, sort, kept),
        aria_sort=_aria_sort(name, sort),
        css=f"{css} first" if interval is None else css,
    )


def score_cells(
    scores: Mapping[str, float | None],
    *,
    decimals: int = SCORED_DECIMALS,
    best: frozenset[str] = frozenset(),
    second: frozenset[str] = frozenset(),
) -> tuple[Cell, ...]:
    """The ten numbers of a result in the paper's order."""
    return tuple(
        Cell(
            text=format_published(scores.get(name), decimals=decimals),
            css=_cell_css(name, scores.get(name), decimals),
            is_best=name in best,
            is_second=name in second,
        )
        for name in SCORE_NAMES
    )


def result_groups(
    scores: Mapping[str, float | None],
    counts: Mapping[str, int],
    *,
    best: frozenset[str] = frozenset(),
    second: frozenset[str] = frozenset(),
) -> tuple[ResultGroup, ...]:
    """The ten numbers of one result, with the number of sequences behind each."""
    headings = [score_heading(name) for name in SCORE_NAMES]
    columns = [
        (heading, cell, grouped(counts.get(heading.caption)))
        for heading, cell in zip(headings, score_cells(scores, best=best, second=second), strict=True)
    ]
    groups = score_groups()
    n_columns = groups[0].n_columns
    return tuple(
        ResultGroup(group=group, columns=tuple(columns[i * n_columns : (i + 1) * n_columns]))
        for i, group in enumerate(groups)
    )


def method_results(results: Iterable[Result]) -> tuple[MethodResult, ...]:
    """A method's results, ready to be placed."""
    return tuple(
        MethodResult(
            result=result,
            groups=result_groups(
                result.entry.scores,
                {"overall": result.edition.ground_truth.n_sequences, **result.edition.ground_truth.counts},
                best=result.entry.best,
                second=result.entry.second,
            ),
        )
        for result in results
    )


@dataclass(frozen=True)
class SubmissionRow:
    """One line of a team's list of submissions."""

    submission: Submission
    state: str
    state_label: str
    cells: tuple[Cell, ...]


def submission_rows(submissions: Iterable[Submission]) -> tuple[SubmissionRow, ...]:
    """A team's submissions with their state and, once scored, their overall errors."""
    rows = []
    for submission in submissions:
        evaluation = evaluation_of(submission)
        scores = flat_scores(evaluation.scores.all())
        cells = [
            cell for name, cell in zip(SCORE_NAMES, score_cells(scores), strict=True) if name in METRIC_TITLES
        ]
        rows.append(
            SubmissionRow(submission, evaluation.status, Status(evaluation.status).label, tuple(cells))
        )
    return tuple(rows)


def _cell_css(name: str, value: float | None, decimals: int) -> str:
    place = {"mid": "primary first", "rte": "overall first"}.get(name, "wide")
    if value is None:
        return f"{place} absent"
    return place if decimals == SCORED_DECIMALS else f"{place} d{decimals}"


def _text_heading(name: str, sort: str, kept: Mapping[str, str]) -> Heading:
    label = {"rank": "Rank", "method": "Method", "team": "Team", "date": "Date"}[name]
    return Heading(
        name=name,
        symbol=label,
        href=_sort_href(name, sort, kept),
        aria_sort=_aria_sort(name, sort),
        css=f"{name} wide" if name in {"team", "date"} else name,
    )


def _sort_href(name: str, sort: str, kept: Mapping[str, str]) -> str:
    """Sort by this column; where it decides already, turn round. Dates begin with the newest."""
    usual, other = (f"-{name}", name) if name == "date" else (name, f"-{name}")
    return "?" + urlencode({**kept, "sort": other if sort == usual else usual})


def _aria_sort(name: str, sort: str) -> str:
    """The attribute's value; empty for the columns that do not decide the order."""
    if sort.removeprefix("-") != name:
        return ""
    return "descending" if sort.startswith("-") else "ascending"


def _row(entry: Entry, source_numbers: Mapping[str, int]) -> Row:
    is_published = entry.kind == "published"
    decimals = printed_decimals(entry.scores.values()) if is_published else SCORED_DECIMALS
    return Row(
        entry=entry,
        rank=ABSENT if entry.rank is None else str(entry.rank),
        team=short_authors(entry.team) if is_published else entry.team,
        cells=score_cells(entry.scores, decimals=decimals, best=entry.best, second=entry.second),
        source_number=source_numbers.get(entry.source),
    )


def _sources(entries: Iterable[Entry]) -> tuple[Source, ...]:
    urls = {entry.source: entry.paper_url for entry in entries if entry.source}
    return tuple(
        Source(number=i, citation=citation, url=urls[citation]) for i, citation in enumerate(sorted(urls), 1)
    )
