"""The table of a board. Templates only place strings: number filters cost more than the query."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date, datetime, timedelta
from typing import Final
from uuid import UUID

from django.core.paginator import Page, Paginator

from evaluator.counting import counted
from evaluator.metrics.protocol import Protocol, TTCRange, grouped_names, range_of, split_name
from evaluator.scoring.scores import floor_sentence
from leaderboard.boards import movement
from leaderboard.boards.listing import Board
from leaderboard.boards.rows import Entry
from leaderboard.exports.tables import team_of
from leaderboard.methods import details
from leaderboard.models import Edition
from leaderboard.statistics import confidence
from leaderboard.web.boards import whiskers
from leaderboard.web.boards.board_query import ALL_COLUMNS, PER_PAGE, BoardQuery
from leaderboard.web.boards.score_columns import (
    Cell,
    Group,
    Heading,
    aria_sort_of,
    ends_of,
    range_css,
    score_cells,
    score_groups,
    score_heading,
    sort_href,
)
from leaderboard.web.boards.whiskers import WhiskerScale

ABSENT: Final = "–"
MAX_COLUMNS: Final = 11  # of scores that fit; a table with more scrolls in a box of its own
N_WHOLE_METRICS: Final = 2  # with a column for each TTC range beside each other
NEW_FOR: Final = timedelta(days=14)
_WHY_UNSCORABLE: Final = {
    "missing-keys": "Edition {} added sequences that its file does not predict.",
    "unknown-keys": "Edition {} removed sequences that its file predicts.",
    "undefined-error": "The protocol of edition {} has no error for predictions that are too close to 0.",
}


@dataclass(frozen=True)
class BoardRow:
    entry: Entry
    team: str
    cells: tuple[Cell, ...]
    rank_range: str
    why_no_interval: str  # for hover, at a value without one
    source_number: int | None
    note: str  # why it stays in an earlier edition
    attempts: str
    chips: tuple[tuple[str, str], ...]
    is_new: bool
    moved: int  # ranks risen in a month; fallen: below 0

    @property
    def n_moved(self) -> int:
        return abs(self.moved)

    @property
    def direction(self) -> str:
        return "up" if self.moved > 0 else "down"

    @property
    def rank(self) -> str:
        """Return its rank, in brackets one that it would have; a dash for none."""
        if self.entry.rank is None:
            return ABSENT
        return f"({self.entry.rank})" if self.is_hypothetical else str(self.entry.rank)

    @property
    def shown_to(self) -> str:
        """Say to its own team who sees the row and how; empty where everybody sees it as it is."""
        if not self.entry.is_mine:
            return ""
        if self.is_hypothetical:
            return f"private, would be rank {self.entry.rank}"
        if not self.entry.is_visible_to_all:
            return "private"
        return f"shown as {self.entry.pseudonym}" if self.entry.pseudonym else ""

    @property
    def is_hypothetical(self) -> bool:
        """Tell whether its rank is the one that it would have if it were public."""
        return self.entry.rank is not None and not self.entry.is_visible_to_all

    @property
    def css(self) -> str:
        """Return the classes of the row."""
        entry = self.entry
        classes = {
            "mine": entry.is_mine,
            "unpublished": not entry.is_visible_to_all,
            "withdrawn": bool(entry.withdrawn_at),
        }
        return " ".join(name for name, holds in classes.items() if holds)

    @property
    def can_be_compared(self) -> bool:
        """Tell whether it can be compared: papers print no values per recording."""
        return self.entry.method_id is not None and self.entry.value is not None


@dataclass(frozen=True)
class BoardTable:
    query: BoardQuery
    text_headings: dict[str, Heading]
    # The ranges that a narrow screen shows one of: class, label, chosen.
    range_choices: tuple[tuple[str, str, bool], ...]
    groups: tuple[Group, ...]
    score_headings: tuple[Heading, ...]
    primary: str  # the symbol of the metric that ranks
    rows: tuple[BoardRow, ...]
    moved_since: datetime | None  # None where no rank has moved
    sources: Sequence[tuple[str, ...]]  # of published rows: citation before, in and after its title; address
    ttc_ranges: list[tuple[TTCRange, int | None]]  # with the number of sequences in each
    pages: "Page[Entry]"
    has_intervals: bool  # beside its whiskers
    has_one_whisker: bool  # in a column of its own before all numbers
    is_log: bool  # whether every whisker is on a logarithmic scale
    can_compare: bool
    reason: str  # why there are no intervals; empty where there are
    floor: str  # what the ground truth itself scores, in words; empty where that is not known

    @property
    def is_ranked_by_another(self) -> bool:
        """Tell whether its first metric is not the one that ranks."""
        return bool(self.rows) and self.groups[0].symbol != self.primary

    @property
    def is_of_one_metric(self) -> bool:
        return self.query.columns != ALL_COLUMNS

    @property
    def is_wide(self) -> bool:
        """Tell whether it has more columns than fit a page."""
        return len(self.score_headings) > MAX_COLUMNS

    @property
    def name_headings(self) -> list[Heading]:
        """Return the headings in the column of the names."""
        return [heading for name, heading in self.text_headings.items() if name != "rank"]

    @property
    def order_of_names(self) -> str:
        """Return the order of the column of the names; empty where rows are sorted by another."""
        return "".join(heading.aria_sort for heading in self.name_headings)

    @property
    def after_unit(self) -> str:
        """Return what the heads of metrics say of the intervals in their columns."""
        if not self.has_intervals or self.has_one_whisker:
            return ""
        return ", 95% CI, log scale" if self.is_log else ", 95% CI"

    @property
    def whisker_heading(self) -> str:
        """Name the one column of whiskers."""
        interval = ", 95% CI" if self.has_intervals else ""
        scale = ", log" if self.is_log else ""
        return f"{self.primary}{interval}{scale}"

    @property
    def is_narrow(self) -> bool:
        """Tell whether its few columns leave a wide page empty."""
        return len(self.score_headings) + sum(bool(each.axis) for each in self.score_headings) <= 7

    @property
    def has_rank_ranges(self) -> bool:
        return any(each.rank_low is not None for row in self.rows for each in row.entry.intervals.values())

    @property
    def has_attempts(self) -> bool:
        """Tell whether rows have room for their numbers of submissions, and have any."""
        return len(self.groups) == N_WHOLE_METRICS and any(row.attempts for row in self.rows)

    @property
    def has_private_rows(self) -> bool:
        return any(not row.entry.is_visible_to_all for row in self.rows)

    @property
    def next_href(self) -> str:
        return self._page_href(self.pages.number + 1) if self.pages.has_next() else ""

    @property
    def previous_href(self) -> str:
        return self._page_href(self.pages.number - 1) if self.pages.has_previous() else ""

    def _page_href(self, number: int) -> str:
        return self.query.href(page=str(number) if number > 1 else "")


def board_table(board: Board, *, query: BoardQuery, now: datetime) -> BoardTable:
    names = shown_names(board.rules, query.columns)
    is_of_one = len(grouped_names(names)) == 1
    has_intervals = any(ends_of(entry, name) for entry in board.entries for name in names)
    scales = _scales(board.entries, names if is_of_one and has_intervals else names[:1])
    pages = Paginator(board.entries, PER_PAGE).get_page(query.page)
    quoted = [entry for entry in pages.object_list if entry.source]
    sources = sorted({(*entry.source.partition(entry.source_title), entry.paper_url) for entry in quoted})
    numbers = {"".join(source[:3]): i for i, source in enumerate(sources, 1)}
    edition = board.edition
    is_present = edition is not None and edition.pk == board.split.current_edition_id and not board.at
    counts = edition.ground_truth.counts if edition else {}
    # Among all rows: no filter makes a row new, or old.
    new = _new_among(board.unfiltered, today=now.date()) if not board.at else frozenset()
    moved = movement.moved(board, now=now)
    rows = tuple(
        BoardRow(
            entry=entry,
            rank_range=rank_range(entry),
            team=team_of(entry),
            cells=score_cells(entry, names=names, scales=scales),
            why_no_interval=_why_no_interval(entry, edition),
            source_number=numbers.get(entry.source),
            note=_note(entry, board.split.current_edition),
            attempts=_attempts(entry),
            chips=tuple(
                chip for chip in details.chips(entry.details, of_row=True) if chip[1] not in entry.method
            ),
            is_new=entry.method_id in new,
            moved=moved.get(entry.method_id, 0) if entry.method_id else 0,
        )
        for entry in pages.object_list
    )
    return BoardTable(
        query=query,
        text_headings={name: _text_heading(name, query) for name in ("rank", "method", "team", "date")},
        range_choices=_range_choices(names, query),
        groups=score_groups(names, n_whiskers=len(scales) if is_of_one else 0),
        has_one_whisker=bool(scales) and not is_of_one,
        is_log=bool(scales) and all(scale.is_log for scale in scales.values()),
        score_headings=tuple(
            score_heading(name, query, scales.get(name), primary=board.rules.primary.name) for name in names
        ),
        primary=board.rules.primary.symbol,
        rows=rows,
        moved_since=movement.since(now=now) if any(row.moved for row in rows) else None,
        sources=sources,
        ttc_ranges=counted_ranges(board.rules, counts),
        pages=pages,
        has_intervals=has_intervals and bool(scales),
        can_compare=is_present and sum(row.can_be_compared for row in rows) > 1,
        reason=_reason(board, has_intervals=has_intervals),
        floor=floor_sentence(edition.floor, decimals=edition.decimals) if edition else "",
    )


def shown_names(rules: Protocol, columns: str) -> tuple[str, ...]:
    """Return the scores with a column: those of the chosen metric, or of all as far as a screen has room.

    Of all metrics together the third and any further one show their overall score; exports have every score.
    """
    names, whole = rules.names_of(columns), rules.overall_names[:N_WHOLE_METRICS]
    if columns in rules.overall_names:
        return names
    return tuple(name for name in names if split_name(name)[0] in whole or name in rules.overall_names)


def _new_among(entries: Sequence[Entry], *, today: date) -> frozenset[UUID]:
    # None where most rows are new: the mark would say nothing.
    new = frozenset(
        entry.method_id
        for entry in entries
        if entry.method_id and entry.listed_at and not entry.withdrawn_at and entry.is_visible_to_all
        if today - entry.listed_at.date() < NEW_FOR
    )
    return new if 2 * len(new) <= len(entries) else frozenset()


def _why_no_interval(entry: Entry, edition: Edition | None) -> str:
    if entry.source or edition is None:
        return "No confidence interval: papers do not report values per recording"
    if entry.withdrawn_at:
        return "Withdrawn"
    return f"No confidence interval: too few {edition.unit_noun}s, or too few with an error"


def _note(entry: Entry, present: Edition | None) -> str:
    """Say why the present edition cannot score a row; it reveals nothing of the file."""
    if present is None or not entry.is_unscorable or entry.withdrawn_at:
        return ""
    return _WHY_UNSCORABLE.get(entry.unscorable, "Edition {} cannot score its file.").format(present.number)


def _reason(board: Board, *, has_intervals: bool) -> str:
    is_scored = any(e.kind == "submission" and e.value is not None for e in board.entries)
    if has_intervals or board.edition is None or not is_scored:
        return ""
    return confidence.why_no_interval(board.edition) or ("The confidence intervals are being computed.")


def _scales(entries: Sequence[Entry], names: Sequence[str]) -> dict[str, WhiskerScale]:
    """Return one scale for these columns, with the best of each, the same on all pages."""
    scales = {}
    for name in names:
        values = [(value, entry) for entry in entries if (value := entry.scores[name]) is not None]
        known = [ends for _, entry in values if (ends := ends_of(entry, name)) is not None]
        public = [(value, ends_of(entry, name)) for value, entry in values if entry.is_visible_to_all]
        best = min(public, default=None, key=lambda each: each[0])
        band = (best[1] or (best[0], best[0])) if best else None
        # Private rows on no public scale: what a reader sees does not depend on what else he may see.
        scale = whiskers.scale_of([value for value, _ in public], known, best=band)
        if scale is not None:
            scales[name] = scale
    limits = [end for scale in scales.values() for end in (scale.low, scale.high)]
    return {name: replace(scale, low=min(limits), high=max(limits)) for name, scale in scales.items()}


def _range_choices(names: Sequence[str], query: BoardQuery) -> tuple[tuple[str, str, bool], ...]:
    sorted_by = query.sort.removeprefix("-")
    chosen = range_css(sorted_by) if sorted_by in names else range_css(names[0])
    labels = {range_css(name): bounds.seconds if (bounds := range_of(name)) else "Overall" for name in names}
    return tuple((css, label, css == chosen) for css, label in labels.items())


def counted_ranges(rules: Protocol, counts: Mapping[str, int]) -> list[tuple[TTCRange, int | None]]:
    """Return the TTC ranges of a protocol with their numbers of sequences."""
    return [(each, counts.get(each.name)) for each in rules.ranges]


def rank_range(entry: Entry) -> str:
    """Word the 95% rank range; empty where its rank is the only one."""
    interval = entry.interval
    if interval.rank_low is None or interval.rank_high is None:
        return ""
    if interval.rank_low == interval.rank_high == entry.rank:
        return ""
    return f"({interval.rank_low}–{interval.rank_high})"


def _text_heading(name: str, query: BoardQuery) -> Heading:
    label = {"rank": "Rank", "method": "Method", "team": "Team", "date": "Date"}[name]
    return Heading(
        name=name,
        symbol=label,
        href=sort_href(name, query),
        aria_sort=aria_sort_of(name, query),
        css=name,
    )


def _attempts(entry: Entry) -> str:
    return "" if entry.n_attempts is None else f"{counted(entry.n_attempts, 'submission')} by the team"
