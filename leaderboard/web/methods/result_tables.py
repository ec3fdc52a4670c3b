"""Tables of results of methods and submissions, with the counts behind each number."""

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from textwrap import shorten
from typing import Any, Final
from urllib.parse import urlencode

from django.urls import reverse

from evaluator.metrics.protocol import OVERALL
from evaluator.scoring.results import format_rounded
from evaluator.tables import sentences
from leaderboard.boards.results import Result
from leaderboard.boards.rows import Entry, flat_scores
from leaderboard.models import Edition, Evaluation, Status, Submission
from leaderboard.statistics.comparisons import MIN_METHODS
from leaderboard.submissions.progress import evaluation_of
from leaderboard.web.boards.score_columns import (
    Cell,
    Group,
    Heading,
    cell_css,
    score_cells,
    score_groups,
    score_heading,
)
from leaderboard.web.boards.tables import rank_range
from leaderboard.web.charts import profile_chart
from leaderboard.web.formatting import grouped

_MAX_REASON: Final = 110


@dataclass(frozen=True)
class ResultGroup:
    """A metric of one result, and its columns."""

    group: Group
    columns: tuple[tuple[Heading, Cell, str], ...]  # each with the number of sequences behind it

    @property
    def has_intervals(self) -> bool:
        return any(cell.interval for _, cell, _ in self.columns)

    @property
    def has_with_best(self) -> bool:
        return any(cell.is_with_best for _, cell, _ in self.columns)


def result_groups(entry: Entry, counts: Mapping[str, int]) -> tuple[ResultGroup, ...]:
    """Return the numbers of one result, with the number of sequences behind each."""
    headings = [score_heading(name, primary=entry.primary) for name in entry.scores]
    columns = iter(
        (heading, cell, grouped(counts.get(heading.caption)))
        for heading, cell in zip(headings, score_cells(entry), strict=True)
    )
    return tuple(
        ResultGroup(group=group, columns=tuple(itertools.islice(columns, group.n_columns)))
        for group in score_groups(entry.scores)
    )


def edition_groups(entry: Entry, edition: Edition) -> tuple[ResultGroup, ...]:
    truth = edition.ground_truth
    return result_groups(entry, {OVERALL: truth.n_sequences, **truth.counts})


def method_result(result: Result) -> dict[str, Any]:
    """Return the result of a method on a split for its page."""
    entry = result.entry
    return {
        "result": result,
        "groups": edition_groups(entry, result.edition),
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
        "profile": profile_chart.profile((entry, *result.neighbours)),
        "compare_href": _compare_href(result),
        "can_compare": entry.value is not None,
    }


def _compare_href(result: Result) -> str:
    ids = [entry.method_id for entry in (result.entry, *result.neighbours) if entry.method_id is not None]
    if len(ids) < MIN_METHODS or result.entry.value is None:
        return ""
    query = urlencode([("split", result.split.pk), *(("m", pk) for pk in ids)])
    return f"{reverse('compare')}?{query}"


def submission_table(submissions: Iterable[Submission]) -> dict[str, Any]:
    """Return the rows of a team's submissions: overall errors, or why there are none."""
    evaluations = [(submission, evaluation_of(submission)) for submission in submissions]
    errors = dict.fromkeys(metric for _, each in evaluations for metric in each.edition.rules.metrics)
    names = {metric.name: metric.symbol for metric in errors}
    rows = []
    for submission, evaluation in evaluations:
        values, edition = flat_scores(evaluation), evaluation.edition
        cells = [
            (
                cell_css(name, value, edition.decimals, primary=edition.rules.primary.name),
                format_rounded(value, decimals=edition.decimals),
                symbol,
            )
            for name, symbol in names.items()
            for value in [values.get(name)]
        ]
        rows.append((submission, evaluation, cells, _reason(evaluation)))
    return {"errors": errors, "rows": rows}


def _reason(evaluation: Evaluation) -> str:
    if evaluation.status == Status.SYSTEM_ERROR:
        return "An error on our side; a maintainer will retry it."
    if evaluation.status != Status.REJECTED or not evaluation.problems:
        return ""
    # The fault says enough here; what was expected is on the submission's page.
    message = evaluation.problems[0]["message"].partition("; expected")[0]
    # Cut between words: the half of a number is another number.
    first = shorten(message, _MAX_REASON, placeholder=" …")
    return f"{evaluation.n_problems:,} problems: {first}" if evaluation.n_problems > 1 else first
