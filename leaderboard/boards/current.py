"""What everybody sees of an edition now: its rows, ranked, and everything that was tried."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any
from uuid import UUID

from leaderboard import standings
from leaderboard.entries import Entry
from leaderboard.models import Edition, Method, Score, Status, Visibility, days


@dataclass(frozen=True)
class Attempt:
    """One standing submission of a method that everybody sees, with its two overall errors."""

    method_id: UUID
    submission_id: UUID
    at: datetime
    mid: float | None = None
    rte: float | None = None


@dataclass(frozen=True)
class Drawn:
    """What everybody sees of an edition: the rows, ranked, and everything that was tried, newest first."""

    entries: tuple[Entry, ...]
    attempts: tuple[Attempt, ...] = ()

    def attempts_of(self, method_id: UUID) -> tuple[Attempt, ...]:
        """What one method tried, newest first."""
        return tuple(attempt for attempt in self.attempts if attempt.method_id == method_id)


def drawn(edition: Edition) -> Drawn:
    """The edition as the database has it, which comes with its split."""
    entries = standings.everybodys(split=edition.split, edition=edition)
    return Drawn(entries=entries, attempts=_attempts(edition))


def _attempts(edition: Edition) -> tuple[Attempt, ...]:
    rows = Score.objects.filter(
        evaluation__edition=edition,
        evaluation__status=Status.SCORED,
        evaluation__submission__withdrawn_at=None,
        evaluation__submission__method__in=Method.objects.shown(),
        interval="overall",
    )
    columns = (
        *("submission__method_id", "submission__method__visibility"),
        *("submission_id", "submission__submitted_at"),
    )
    found: dict[UUID, dict[str, Any]] = {}
    for method_id, visibility, pk, sent_at, metric, value in rows.values_list(
        *(f"evaluation__{column}" for column in columns), "metric", "value"
    ):
        at = days.told(sent_at, is_masked=visibility == Visibility.ANONYMOUS)
        found.setdefault(pk, {"method_id": method_id, "submission_id": pk, "at": at})[metric] = value
    attempts = (Attempt(**said) for said in found.values())
    return tuple(sorted(attempts, key=lambda a: (a.at, a.submission_id.int), reverse=True))
