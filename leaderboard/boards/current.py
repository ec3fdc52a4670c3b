"""The public rows of an edition now, ranked, and the submissions behind them."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from uuid import UUID

from evaluator.metrics.protocol import OVERALL
from leaderboard.boards import boards
from leaderboard.boards.rows import Entry
from leaderboard.models import Edition, Method, Score, Status, Visibility, days
from leaderboard.models.methods import MethodQuerySet


@dataclass(frozen=True, slots=True)
class Attempt:
    """One standing submission of a method, with its overall scores."""

    method_id: UUID
    submission_id: UUID
    at: datetime
    scores: Mapping[str, float | None]


@dataclass(frozen=True)
class CurrentBoard:
    """What everybody sees of an edition: the rows, ranked, and everything that was tried, newest first."""

    entries: tuple[Entry, ...]
    attempts: tuple[Attempt, ...] = ()


def read(edition: Edition) -> CurrentBoard:
    """The edition as the database has it, which comes with its split."""
    entries = boards.public_rows(split=edition.split, edition=edition)
    return CurrentBoard(entries=entries, attempts=attempts(edition, methods=Method.objects.shown()))


def attempts(edition: Edition, *, methods: MethodQuerySet) -> tuple[Attempt, ...]:
    """The standing, scored submissions of these methods, the newest first."""
    rows = Score.objects.filter(
        evaluation__edition=edition,
        evaluation__status=Status.SCORED,
        evaluation__submission__withdrawn_at=None,
        evaluation__submission__method__in=methods,
        interval=OVERALL,
    )
    columns = (
        *("submission__method_id", "submission__method__visibility"),
        *("submission_id", "submission__submitted_at"),
    )
    found: dict[UUID, Attempt] = {}
    values: dict[UUID, dict[str, float | None]] = {}
    for method_id, visibility, pk, sent_at, metric, value in rows.values_list(
        *(f"evaluation__{column}" for column in columns), "metric", "value"
    ):
        if pk not in found:
            at = days.truncate_to_day(sent_at, is_masked=visibility == Visibility.ANONYMOUS)
            values[pk] = dict.fromkeys(edition.rules.overall_names)
            found[pk] = Attempt(method_id, pk, at, values[pk])
        values[pk][metric] = value
    return tuple(sorted(found.values(), key=lambda a: (a.at, a.submission_id.int), reverse=True))
