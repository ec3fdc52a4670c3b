"""Results of single methods and submissions as they are drawn: ten numbers and what stands behind each."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from types import MappingProxyType
from urllib.parse import urlencode

from django.urls import reverse

from evaluator.protocol import SCORE_NAMES
from evaluator.report import format_published
from leaderboard.comparisons import MIN_METHODS
from leaderboard.entries import Interval
from leaderboard.methods import Result
from leaderboard.models import Status, Submission
from leaderboard.standings import flat_scores
from leaderboard.submissions import evaluation_of
from leaderboard.templatetags.board import grouped
from leaderboard.web import charts
from leaderboard.web.charts import Chart
from leaderboard.web.tables import (
    METRIC_TITLES,
    Cell,
    Group,
    Heading,
    rank_range,
    score_cells,
    score_groups,
    score_heading,
)


@dataclass(frozen=True)
class ResultColumn:
    """One of the ten numbers: its head, its value, its interval in words, and the sequences behind it."""

    heading: Heading
    cell: Cell
    count: str


@dataclass(frozen=True)
class ResultGroup:
    """One of the two errors of one result: five columns."""

    group: Group
    columns: tuple[ResultColumn, ...]

    @property
    def has_intervals(self) -> bool:
        """Whether any of the values has one: else the row for them is left out."""
        return any(column.cell.interval for column in self.columns)

    @property
    def has_with_best(self) -> bool:
        """Whether any is marked as one that may be the best: else the mark needs no explanation."""
        return any(column.cell.is_with_best for column in self.columns)


@dataclass(frozen=True)
class AttemptRow:
    """One submission of a method: when it came, its two overall errors, and whether it is what stands."""

    at: datetime
    mid: str
    rte: str
    is_best: bool


@dataclass(frozen=True)
class MethodResult:
    """What a method achieved on a split, ready to be placed."""

    result: Result
    groups: tuple[ResultGroup, ...]
    rank_range: str
    attempts: tuple[AttemptRow, ...]
    profile: Chart
    compare_href: str  # with its neighbours; empty where none can be compared


@dataclass(frozen=True)
class SubmissionRow:
    """One line of a team's list of submissions."""

    submission: Submission
    state: str
    state_label: str
    cells: tuple[Cell, ...]


def result_groups(
    scores: Mapping[str, float | None],
    counts: Mapping[str, int],
    *,
    intervals: Mapping[str, Interval] = MappingProxyType({}),
    decimals: int,
    best: frozenset[str] = frozenset(),
    second: frozenset[str] = frozenset(),
) -> tuple[ResultGroup, ...]:
    """The ten numbers of one result, with the number of sequences behind each."""
    headings = [score_heading(name) for name in SCORE_NAMES]
    cells = score_cells(scores, intervals=intervals, decimals=decimals, best=best, second=second)
    columns = [
        ResultColumn(heading, cell, grouped(counts.get(heading.caption)))
        for heading, cell in zip(headings, cells, strict=True)
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
                intervals=result.entry.intervals,
                decimals=result.entry.decimals,
                best=result.entry.best,
                second=result.entry.second,
            ),
            rank_range=rank_range(result.entry),
            attempts=tuple(
                AttemptRow(
                    at=attempt.at,
                    mid=format_published(attempt.mid, decimals=result.entry.decimals),
                    rte=format_published(attempt.rte, decimals=result.entry.decimals),
                    is_best=attempt.submission_id == result.entry.submission_id,
                )
                for attempt in result.attempts
            ),
            profile=charts.profile((result.entry, *result.neighbours)),
            compare_href=_compare_href(result),
        )
        for result in results
    )


def _compare_href(result: Result) -> str:
    ids = [entry.method_id for entry in (result.entry, *result.neighbours) if entry.method_id is not None]
    if len(ids) < MIN_METHODS or result.entry.scores["mid"] is None:
        return ""
    query = urlencode([("split", result.split.pk), *(("m", pk) for pk in ids)])
    return f"{reverse('compare')}?{query}"


def submission_rows(submissions: Iterable[Submission]) -> tuple[SubmissionRow, ...]:
    """A team's submissions with their state and, once scored, their overall errors."""
    rows = []
    for submission in submissions:
        evaluation = evaluation_of(submission)
        scores = flat_scores(evaluation.scores.all())
        cells = score_cells(scores, names=tuple(METRIC_TITLES), decimals=evaluation.edition.decimals)
        rows.append(SubmissionRow(submission, evaluation.status, Status(evaluation.status).label, cells))
    return tuple(rows)
