"""The score that ranks an entry, for the head of its page: rank, difference to the best, all others."""

from collections.abc import Sequence
from typing import NamedTuple

from django.conf import settings
from django.utils.safestring import SafeString

from evaluator.metrics.protocol import metric_of
from evaluator.metrics.registry import Metric
from evaluator.scoring.results import format_rounded
from leaderboard.boards.rows import Entry
from leaderboard.exports import tables
from leaderboard.statistics.comparisons import Pair
from leaderboard.web.boards import whiskers
from leaderboard.web.boards.score_columns import NOTHING, interval_words
from leaderboard.web.boards.tables import rank_range
from leaderboard.web.formatting import signed


class Gap(NamedTuple):
    """The difference of an entry to another one in the score that ranks: below 0 the entry is better.

    `size` is that of a lead, of an entry of rank 1, or else of what the entry is behind.
    """

    other: Entry
    value: str  # of the other
    text: str
    interval: str
    size: str
    size_interval: str
    is_significant: bool
    why_not_tested: str
    is_waiting: bool


class ScoreCard(NamedTuple):
    entry: Entry
    metric: Metric
    value: str
    interval: str
    rank_range: str
    n_ranked: int
    gap: Gap | None  # to the best of the others
    strip: SafeString
    strip_words: str
    is_log: bool  # the scale of the strip
    ends: tuple[str, str]  # the lowest and the highest value on it

    @property
    def caption(self) -> str:
        """Say what the strip draws, and whether its board shows the tall mark."""
        scale = " (log scale)" if self.is_log else ""
        if not self.entry.rank:
            mark = "submission, which the board does not show"
        else:
            mark = "one" if self.entry.is_visible_to_all else "one, which is private"
        return (
            f"{self.metric.symbol} of every method on the board{scale}, from {' to '.join(self.ends)}; "
            f"the tall mark is this {mark}. Lower is better."
        )


def score_card(entry: Entry, rows: Sequence[Entry], *, n_ranked: int, gap: Gap | None) -> ScoreCard | None:
    """Make the card of an entry among `rows`, which everybody sees; None without a value."""
    if entry.value is None:
        return None
    # An entry without a rank is not the best of its method: the board's row of that method is another one.
    others = [row for row in rows if entry.rank is None or row.method_id != entry.method_id]
    values = [row.value for row in others if row.value is not None]
    known = [*values, entry.value]
    metric = metric_of(entry.primary)
    n_better = sum(value < entry.value for value in values)
    words = f"{metric.symbol} of all methods: {n_better} lower, {len(values) - n_better} not."
    return ScoreCard(
        entry=entry,
        metric=metric,
        value=format_rounded(entry.value, decimals=entry.decimals),
        interval=interval_words(entry.interval, decimals=entry.decimals),
        rank_range=rank_range(entry),
        n_ranked=n_ranked,
        gap=gap,
        strip=whiskers.strip(values, own=entry.value) if len(values) > 1 else NOTHING,
        strip_words=words,
        is_log=whiskers.WhiskerScale(min(known), max(known)).is_log,
        ends=_ends([entry, *(row for row in others if row.value is not None)]),
    )


def _ends(rows: Sequence[Entry]) -> tuple[str, str]:
    lowest, highest = (choose(rows, key=lambda row: row.value or 0.0) for choose in (min, max))
    return (
        format_rounded(lowest.value, decimals=lowest.decimals),
        format_rounded(highest.value, decimals=highest.decimals),
    )


def gap_of(pair: Pair) -> Gap:
    """Word the difference of a pair, with its interval where that is known."""
    entry, other, difference = pair.first, pair.second, pair.difference
    decimals = max(entry.decimals, other.decimals)
    known = difference.difference if difference else (entry.value or 0.0) - (other.value or 0.0)
    ends = [end for end in (difference.low, difference.high) if end is not None] if difference else []
    sign = -1 if entry.rank == 1 else 1
    sizes = [signed(sign * end, decimals=decimals).lstrip("+") for end in (known, *ends[::sign])]
    return Gap(
        other=other,
        value=format_rounded(other.value, decimals=other.decimals),
        text=signed(known, decimals=decimals),
        interval=" to ".join(signed(end, decimals=decimals) for end in ends),
        size=sizes[0],
        size_interval=" to ".join(sizes[1:]),
        is_significant=bool(difference and difference.is_significant),
        why_not_tested=pair.withheld,
        is_waiting=difference is None,
    )


def gap_to_best(entry: Entry, rows: Sequence[Entry]) -> Gap | None:
    """Word the difference to the best other row, without its interval; None without another one."""
    others = [row for row in rows if row.value is not None and row.method_id != entry.method_id]
    if entry.value is None or not others:
        return None
    # A worker computes more for the pages of methods.
    return gap_of(Pair(entry, min(others, key=lambda row: row.value or 0.0), None))


def citation(card: ScoreCard, *, split: str, edition: int | None) -> str:
    """Word a score as one quotes it: method, value, interval, rank, and where and when it was submitted."""
    entry = tables.as_printed(card.entry)
    interval = f" (95% CI [{card.interval.replace(' to ', ', ')}])" if card.interval else ""
    rank = f", rank {entry.rank}{f' {card.rank_range}' if card.rank_range else ''} of {card.n_ranked}"
    value = f"{card.metric.symbol} {card.value} {card.metric.unit}".rstrip()
    board = f"{settings.BENCHMARK.name} {split}, edition {edition}"
    date = f", submitted {entry.date:%Y-%m-%d}" if entry.date else ""
    return f"{entry.method}: {value}{interval}{rank if entry.rank else ''}, {board}{date}"
