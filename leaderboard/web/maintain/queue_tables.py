"""The queue as maintainers look at it: what failed by our fault, what runs, what waits."""

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final
from uuid import UUID

from django.core.paginator import Page, Paginator
from django.db.models import Count, Min, QuerySet

from leaderboard import clock, health
from leaderboard.lifecycle import MAX_INFRASTRUCTURE_STRIKES, MAX_POISON_STRIKES
from leaderboard.models import Evaluation, Status, Visibility
from leaderboard.templatetags.board import duration, grouped

PER_PAGE: Final = 50
PER_SECTION: Final = 20
_PRIORITIES: Final = {Evaluation.PRIORITY_LIVE: "live", Evaluation.PRIORITY_RESCORE: "re-score"}


@dataclass(frozen=True)
class State:
    """One of the three lists: what is in it, in which order, and what is said when nothing is."""

    status: Status
    heading: str
    none: str
    since: str  # the time that its rows tell
    order: tuple[str, ...]


STATES: Final[Mapping[str, State]] = {
    "failed": State(
        Status.SYSTEM_ERROR,
        "Failed by our fault",
        "Nothing failed by our fault.",
        "finished_at",
        ("-finished_at",),
    ),
    "running": State(Status.RUNNING, "Running", "Nothing runs.", "started_at", ("started_at",)),
    # As workers take it.
    "waiting": State(Status.QUEUED, "Waiting", "Nothing waits.", "queued_at", ("priority", "queued_at")),
}


@dataclass(frozen=True)
class Row:
    """One evaluation, ready to be placed. `until` is None where that moment is over, or there is none."""

    evaluation_id: UUID
    submission_id: UUID
    at: datetime | None
    method: str
    tag: str  # what a maintainer has to know of the method or the submission
    team: str
    submitter: str
    split: str
    edition: int
    priority: str
    n_tries: int
    strikes: str
    claim: str  # which claim of a worker holds it
    until: datetime | None  # running: end of the lease; waiting: not to be begun before
    error: str


@dataclass(frozen=True)
class Section:
    """One list, or one page of it."""

    name: str
    state: State
    n: int
    page: Page[Evaluation]
    rows: tuple[Row, ...]

    @property
    def is_cut(self) -> bool:
        """Whether there is more of it than is shown."""
        return len(self.rows) < self.n


@dataclass(frozen=True)
class Totals:
    """How many there are of each, and since when the oldest of those that wait has waited."""

    counts: tuple[tuple[str, str, int], ...]  # name, heading, number
    oldest_at: datetime | None
    oldest_age: str

    @property
    def words(self) -> str:
        """The counts as part of a sentence."""
        n = {name: count for name, _, count in self.counts}
        age = f", the oldest for {self.oldest_age}" if self.oldest_at else ""
        return (
            f"{grouped(n['failed'])} failed by our fault, {grouped(n['running'])} running, "
            f"{grouped(n['waiting'])} waiting{age}"
        )


@dataclass(frozen=True)
class Shown:
    """Everything that the queue's template places. `seen` changes exactly when what is shown does."""

    totals: Totals
    sections: tuple[Section, ...]
    faults: tuple[str, ...]
    seen: str


def totals(*, split: str = "") -> Totals:
    """What the queue holds, of one split or of all."""
    found = _of(split).filter(status__in=[state.status for state in STATES.values()])
    grouped_rows = found.order_by().values_list("status").annotate(n=Count("pk"), oldest_at=Min("queued_at"))
    by_status: dict[str, tuple[int, datetime]] = {
        status: (n, oldest_at) for status, n, oldest_at in grouped_rows
    }
    counts = tuple(
        (name, state.heading, by_status[state.status][0] if state.status in by_status else 0)
        for name, state in STATES.items()
    )
    oldest_at = by_status[Status.QUEUED][1] if Status.QUEUED in by_status else None
    age = duration((clock.database_now() - oldest_at).total_seconds()) if oldest_at else ""
    return Totals(counts=counts, oldest_at=oldest_at, oldest_age=age)


def shown(*, state: str = "", split: str = "", number: Any = 1) -> Shown:
    """The queue: the beginning of each list, or with `state` page `number` of that one."""
    counted = totals(split=split)
    now = clock.database_now()
    names = [state] if state else list(STATES)
    sections = tuple(
        _section(name, split=split, number=number, is_whole=bool(state), now=now, counted=counted)
        for name in names
    )
    faults = tuple(_faults())
    seen = repr((counted, faults, [(each.n, each.page.number, each.rows) for each in sections]))
    return Shown(
        totals=counted, sections=sections, faults=faults, seen=hashlib.sha256(seen.encode()).hexdigest()[:16]
    )


def _of(split: str) -> QuerySet[Evaluation]:
    rows = Evaluation.objects.all()
    return rows.filter(submission__split=split) if split else rows


def _section(
    name: str, *, split: str, number: Any, is_whole: bool, now: datetime, counted: Totals
) -> Section:
    state = STATES[name]
    rows = (
        _of(split)
        .filter(status=state.status)
        .select_related("submission__method__team", "submission__submitted_by", "edition")
        # They are large, and not shown.
        .defer("report", "problems")
        .order_by(*state.order, "pk")
    )
    paginator = Paginator(rows, PER_PAGE if is_whole else PER_SECTION)
    # Counted already, for all lists at once.
    paginator.count = next(n for each, _, n in counted.counts if each == name)
    page = paginator.get_page(number if is_whole else 1)
    return Section(name=name, state=state, n=paginator.count, page=page, rows=_rows(page, state, now=now))


def _rows(evaluations: Iterable[Evaluation], state: State, *, now: datetime) -> tuple[Row, ...]:
    return tuple(_row(each, state, now=now) for each in evaluations)


def _row(evaluation: Evaluation, state: State, *, now: datetime) -> Row:
    submission, is_running = evaluation.submission, state.status == Status.RUNNING
    until = evaluation.leased_until if is_running else evaluation.due_at
    return Row(
        evaluation_id=evaluation.pk,
        submission_id=submission.pk,
        at=getattr(evaluation, state.since),
        method=submission.method.name,
        tag=", ".join(_tags(evaluation)),
        team=submission.method.team.name,
        submitter=submission.submitted_by.email,
        split=submission.split_id,
        edition=evaluation.edition.number,
        priority=_PRIORITIES.get(evaluation.priority, str(evaluation.priority)),
        n_tries=evaluation.attempt,
        strikes=strike_words(evaluation),
        # Its beginning tells claims apart; the whole is the right to decide.
        claim=str(evaluation.lease_token)[:8] if is_running else "",
        until=until if until and until > now else None,
        error=evaluation.last_error,
    )


def _tags(evaluation: Evaluation) -> Iterable[str]:
    """Why scoring it may matter less, and that others do not see its method."""
    if evaluation.submission.method.visibility != Visibility.PUBLIC:
        yield evaluation.submission.method.get_visibility_display()
    if evaluation.submission.withdrawn_at:
        yield "withdrawn"
    if evaluation.edition.discarded_at:
        yield "edition given up"


def strike_words(evaluation: Evaluation) -> str:
    """How many of its runs came to nothing, and by what; empty if none did.

    >>> strike_words(Evaluation(n_poison_strikes=2))
    'poison 2 of 3'
    """
    strikes: Sequence[tuple[str, int, int]] = (
        ("poison", evaluation.n_poison_strikes, MAX_POISON_STRIKES),
        ("infrastructure", evaluation.n_infrastructure_strikes, MAX_INFRASTRUCTURE_STRIKES),
    )
    return ", ".join(f"{kind} {n} of {most}" for kind, n, most in strikes if n)


def _faults() -> Iterable[str]:
    """Why what waits may go on waiting."""
    age_s = health.sweep_age_s()
    if age_s is None or age_s > health.MAX_SWEEP_AGE_S:
        yield f"There was no sweep in the last {health.MAX_SWEEP_AGE_S:.0f} s: beat or every worker is gone."
    n_out_of_reach = health.n_out_of_reach()
    if n_out_of_reach:
        yield (
            f"At the last sweep {grouped(n_out_of_reach)} of what waits needed a ground truth that the "
            "worker which swept cannot read."
        )
