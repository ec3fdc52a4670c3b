"""Three to five methods at a glance: the difference of every pair, and of all to the best on one scale."""

import math
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from django.utils.safestring import SafeString

from evaluator import Difference
from evaluator.scoring.significance import significant_together
from evaluator.tables.sentences import p_cell
from leaderboard.boards.rows import Entry
from leaderboard.statistics.comparisons import Compared, Pair
from leaderboard.web.charts import svg
from leaderboard.web.formatting import signed

_SIGNIFICANTLY: Final = "significantly {}"
_HERE_ALONE: Final = "significantly {} among these methods, not among all of the board"


class MatrixCell(NamedTuple):
    """The row's value minus the column's; all is empty on the diagonal."""

    text: str = ""
    css: str = ""  # better or worse where significant
    hint: str = ""


class ForestRow(NamedTuple):
    """The interval of the difference of one method from the best, as text and drawn."""

    entry: Entry
    drawing: SafeString
    interval: str
    p: str


class Matrix(NamedTuple):
    """Methods from the best to the worst, the cells of each, and the forest plot of all against the best."""

    rows: tuple[tuple[Entry, tuple[MatrixCell, ...]], ...]
    forest: tuple[ForestRow, ...]
    axis: SafeString
    n_tested: int


def best_entry(entries: Sequence[Entry]) -> Entry:
    """Return the entry with the lowest score that ranks."""
    return min(entries, key=lambda entry: entry.value or 0.0)


def tested_pairs(compared: Compared) -> list[Pair]:
    """Return the pairs that have a p-value or its class, or would have with more recordings."""
    return [pair for pair in compared.pairs if not pair.withheld and pair.difference is not None]


class Findings(NamedTuple):
    """The pairs that differ significantly, and those that do so among these methods alone."""

    significant: list[Pair]
    here_alone: list[Pair]


def findings(compared: Compared) -> Findings:
    """Sort out the pairs that differ significantly, all of them tested together.

    The best is chosen from the data, so no pair is tested alone. The board tests more pairs at once: what it
    still marks as possibly the best is worse among these methods alone.
    """
    best, tested = best_entry(compared.entries), tested_pairs(compared)
    apart = significant_together([pair.difference for pair in tested if pair.difference])
    sorted_out = Findings([], [])
    for pair, is_apart in zip(tested, apart, strict=True):
        better, worse = sorted((pair.first, pair.second), key=lambda entry: entry.value or 0.0)
        may_be_best = better is best and worse.interval.is_with_best
        if _is_apart_on_the_board(better, worse) or (is_apart and not may_be_best):
            sorted_out.significant.append(pair)
        elif is_apart:
            sorted_out.here_alone.append(pair)
    return sorted_out


def _is_apart_on_the_board(better: Entry, worse: Entry) -> bool:
    return (better.interval.rank_high or math.inf) < (worse.interval.rank_low or 0)


def difference_matrix(compared: Compared) -> Matrix | None:
    """Return the matrix of a complete comparison of three methods or more, by the score that ranks."""
    if len(compared.entries) < 3 or not compared.is_complete:
        return None
    entries = sorted(compared.entries, key=lambda entry: entry.value or 0.0)
    differences: dict[tuple[str, str], Difference] = {}
    for pair in compared.pairs:
        if pair.difference is not None:
            differences[pair.first.id, pair.second.id] = pair.difference
            differences[pair.second.id, pair.first.id] = pair.difference.turned()
    words = {
        frozenset((pair.first.id, pair.second.id)): word
        for word, pairs in zip((_SIGNIFICANTLY, _HERE_ALONE), findings(compared), strict=True)
        for pair in pairs
    }
    rows = tuple(
        (row, tuple(_cell(row, column, differences, words) for column in entries)) for row in entries
    )
    n_tested = sum(each.p_below is not None for each in differences.values()) // 2
    return Matrix(rows, *_forest(entries, differences), n_tested)


def _cell(
    row: Entry,
    column: Entry,
    differences: Mapping[tuple[str, str], Difference],
    words: Mapping[frozenset[str], str],
) -> MatrixCell:
    difference = differences.get((row.id, column.id))
    if difference is None:
        return MatrixCell()
    text = signed(difference.difference, decimals=row.decimals)
    if difference.p_below is None:
        return MatrixCell(text, hint="no test")
    word = words.get(frozenset((row.id, column.id)))
    if word is None:
        return MatrixCell(text, hint="not significant")
    css = "better" if difference.difference < 0 else "worse"
    return MatrixCell(text, css, word.format(css))


def _forest(
    entries: Sequence[Entry], differences: Mapping[tuple[str, str], Difference]
) -> tuple[tuple[ForestRow, ...], SafeString]:
    best, *others = entries
    to_best = [
        (entry, difference)
        for entry in others
        if (difference := differences.get((entry.id, best.id))) is not None and difference.low is not None
    ]
    end = svg.scale_end(
        value for _, each in to_best for value in (each.low, each.high, each.difference) if value is not None
    )
    # None is better than the best: the scale begins at 0, or where an interval does.
    below = [-each.low for _, each in to_best if each.low is not None and each.low < 0]
    start = -svg.scale_end(below) if below else 0.0
    if not to_best:
        return (), SafeString("")
    origin = ForestRow(best, svg.difference(end, 0.0, None, None, start=start), "best", "")
    rows = tuple(
        ForestRow(
            entry=entry,
            drawing=svg.difference(end, each.difference, each.low, each.high, start=start),
            interval=interval_of(each, decimals=entry.decimals),
            p=p_cell(each.p, each.p_below),
        )
        for entry, each in to_best
    )
    return (origin, *rows), svg.axis(end, start=start)


def interval_of(difference: Difference, *, decimals: int) -> str:
    """Word the interval of a difference with signs; empty where it is not known."""
    if difference.low is None or difference.high is None:
        return ""
    return f"{signed(difference.low, decimals=decimals)} to {signed(difference.high, decimals=decimals)}"
