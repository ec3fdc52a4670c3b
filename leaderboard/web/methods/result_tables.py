"""Tables of results of methods and submissions, with the counts behind each number."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from textwrap import shorten
from typing import Any, Final, NamedTuple
from urllib.parse import urlencode

from django.urls import reverse

from evaluator.metrics.protocol import OVERALL, grouped_names
from evaluator.metrics.registry import Metric
from evaluator.scoring.results import format_rounded
from evaluator.tables import sentences
from leaderboard.boards.results import OwnRows, Result
from leaderboard.boards.rows import Entry, flat_scores
from leaderboard.models import Edition, Evaluation, Status, Submission
from leaderboard.statistics.comparisons import MIN_METHODS, Pair
from leaderboard.submissions.progress import evaluation_of
from leaderboard.submissions.status_text import short_fault
from leaderboard.web.boards import whiskers
from leaderboard.web.boards.score_columns import (
    Cell,
    Heading,
    cell_css,
    ends_of,
    score_cells,
    score_heading,
)
from leaderboard.web.boards.tables import rank_range
from leaderboard.web.formatting import grouped
from leaderboard.web.methods.score_cards import Gap, citation, gap_of, gap_to_best, score_card

_MAX_REASON: Final = 110


class RangeRow(NamedTuple):
    """The scores of one result over one TTC range, a cell for each metric."""

    heading: Heading
    cells: tuple[Cell, ...]
    n_sequences: str  # of the sequences in it


@dataclass(frozen=True)
class ResultTable:
    """The numbers of one result: a row for each TTC range, a column for each metric."""

    metrics: tuple[Metric, ...]
    rows: tuple[RangeRow, ...]
    without_interval: tuple[str, ...] = ()  # of a row with intervals: what has none, and why

    @property
    def definitions(self) -> str:
        """Return its metrics in words, with their symbols."""
        return f"{', '.join(f'{metric.title} ({metric.symbol})' for metric in self.metrics)}."

    @property
    def has_intervals(self) -> bool:
        return any(cell.interval for row in self.rows for cell in row.cells)

    @property
    def has_marks(self) -> bool:
        cells = [cell for row in self.rows for cell in row.cells]
        return any(cell.is_best or cell.is_second or cell.is_with_best for cell in cells)


def result_table(entry: Entry, counts: Mapping[str, int]) -> ResultTable:
    """Return the numbers of one result, with the number of sequences behind each."""
    columns = grouped_names(entry.scores)
    cells = [score_cells(entry, names=names) for names in columns.values()]
    headings = [score_heading(name, primary=entry.primary) for name in next(iter(columns.values()))]
    return ResultTable(
        metrics=tuple(columns),
        rows=tuple(
            RangeRow(heading, tuple(of_range), grouped(counts.get(heading.caption)))
            for heading, *of_range in zip(headings, *cells, strict=True)
        ),
    )


def edition_table(entry: Entry, edition: Edition) -> ResultTable:
    truth = edition.ground_truth
    counts = {OVERALL: truth.n_sequences, **truth.counts}
    table = result_table(entry, counts)
    if not table.has_intervals:
        return table
    reasons = sentences.without_interval(
        {name: value for name, value in entry.scores.items() if ends_of(entry, name) is None},
        counts=counts,
        decimals=entry.decimals,
        n_effective=edition.n_effective,
        unit=edition.unit,
    )
    return replace(table, without_interval=tuple(reasons))


def method_result(result: Result, pairs: Sequence[Pair]) -> dict[str, Any]:
    """Return the result of a method on a split for its page; `pairs` are with `result.rivals`."""
    entry, gaps = result.entry, [gap_of(pair) for pair in pairs]
    gap = next((each for each in gaps if result.best and each.other.id == result.best.id), None)
    card = score_card(entry, result.rows, n_ranked=result.n_ranked, gap=gap)
    values = [attempt.value for attempt in reversed(result.attempts) if attempt.value is not None]
    # Of an anonymous method only days are known, and no order within a day.
    is_ordered = len({attempt.at for attempt in result.attempts}) == len(result.attempts)
    return {
        "result": result,
        "table": edition_table(entry, result.edition),
        "card": card,
        "citation": citation(card, split=result.split.title, edition=result.edition.number)
        if card and entry.rank and entry.is_visible_to_all
        else "",
        "nearby": _nearby(entry, gaps),
        "is_tested": any(not each.why_not_tested for each in gaps),
        "why_not_tested": dict.fromkeys(each.why_not_tested for each in gaps if each.why_not_tested),
        "history": whiskers.sparkline(values) if len(values) > 1 and is_ordered else "",
        "first_and_last": [
            format_rounded(value, decimals=entry.decimals) for value in values[:: len(values) - 1]
        ]
        if len(values) > 1
        else [],
        "rank_range": rank_range(entry),
        "errors": result.edition.rules.metrics,
        "attempts": [
            (
                attempt.at,
                [format_rounded(value, decimals=entry.decimals) for value in attempt.scores.values()],
                attempt.submission_id == entry.submission_id,
                attempt.submission_id,
            )
            for attempt in result.attempts
        ],
        "selection": sentences.selection({entry.method: len(result.attempts)}) if rank_range(entry) else "",
        "compare_href": _compare_href(result),
        "can_compare": entry.value is not None,
    }


def _nearby(entry: Entry, gaps: Sequence[Gap]) -> list[Gap | None]:
    """Return the rows of nearby ranks: None is the entry itself, in its place."""
    n_better = sum((gap.other.rank or 0) < (entry.rank or 0) for gap in gaps)
    return [*gaps[:n_better], None, *gaps[n_better:]] if gaps else []


def _compare_href(result: Result) -> str:
    ids = [entry.method_id for entry in (result.entry, *result.neighbours) if entry.method_id is not None]
    if len(ids) < MIN_METHODS or result.entry.value is None:
        return ""
    query = urlencode([("split", result.split.pk), *(("m", pk) for pk in ids)])
    return f"{reverse('compare')}?{query}"


def best_of_team(board: OwnRows) -> dict[str, Any]:
    """Return the best score of a team on one board, and where it is compared with the best of the others."""
    entry = board.own[0]
    gap = gap_to_best(entry, board.rows)
    other = gap.other.method_id if gap else None
    query = [("split", board.split.pk), *(("m", pk) for pk in (entry.method_id, other))]
    return {
        "split": board.split,
        "card": score_card(entry, board.rows, n_ranked=board.n_ranked, gap=gap),
        "compare_href": f"{reverse('compare')}?{urlencode(query)}" if other else "",
    }


def submission_table(submissions: Iterable[Submission]) -> dict[str, Any]:
    """Return the rows of a team's submissions: overall errors, or why there are none."""
    evaluations = [(submission, evaluation_of(submission)) for submission in submissions]
    errors = dict.fromkeys(metric for _, each in evaluations for metric in each.edition.rules.metrics)
    names = {metric.name: metric.heading for metric in errors}
    rows = []
    for submission, evaluation in evaluations:
        values, edition = flat_scores(evaluation), evaluation.edition
        cells = [
            (
                cell_css(name, value, edition.decimals, primary=edition.rules.primary.name),
                format_rounded(value, decimals=edition.decimals),
                heading,
            )
            for name, heading in names.items()
            for value in [values.get(name)]
        ]
        rows.append((submission, evaluation, cells, _reason(evaluation)))
    has_people = len({submission.submitted_by_id for submission, _ in evaluations}) > 1
    return {"errors": errors, "rows": rows, "has_people": has_people}


def _reason(evaluation: Evaluation) -> str:
    if evaluation.status == Status.SYSTEM_ERROR:
        return "An error on our side; a maintainer will retry it."
    if evaluation.status != Status.REJECTED or not evaluation.problems:
        return ""
    # The fault says enough here; its places, and what was expected, are on the submission's page.
    message = short_fault(evaluation.problems[0]["message"])
    # Cut between words: the half of a number is another number.
    first = shorten(message, _MAX_REASON, placeholder=" …")
    return f"{evaluation.n_problems:,} problems; first: {first}" if evaluation.n_problems > 1 else first
