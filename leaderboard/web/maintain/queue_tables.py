"""Tables of the queue: system errors, running and waiting evaluations."""

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from django.core.paginator import Paginator
from django.db.models import Count, Min, QuerySet

from leaderboard.db import clock
from leaderboard.models import Evaluation, Status, Visibility
from leaderboard.ops import health
from leaderboard.scoring.lifecycle import MAX_INFRASTRUCTURE_STRIKES, MAX_POISON_STRIKES
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
    order: tuple[str, ...]  # empty: as workers take it


STATES: Final[Mapping[str, State]] = {
    "failed": State(
        Status.SYSTEM_ERROR,
        "System errors",
        "No system errors.",
        "finished_at",
        ("-finished_at",),
    ),
    "running": State(Status.RUNNING, "Running", "No running evaluations.", "started_at", ("started_at",)),
    "waiting": State(Status.QUEUED, "Waiting", "No waiting evaluations.", "queued_at", ()),
}


@dataclass(frozen=True)
class Totals:
    """How many there are of each, and how long the oldest of those that wait has waited."""

    counts: tuple[tuple[str, str, int], ...]  # name, heading, number
    oldest_age: str

    @property
    def words(self) -> str:
        """The counts as part of a sentence."""
        n = {name: count for name, _, count in self.counts}
        age = f", the oldest for {self.oldest_age}" if self.oldest_age else ""
        return (
            f"{grouped(n['failed'])} with system errors, {grouped(n['running'])} running, "
            f"{grouped(n['waiting'])} waiting{age}"
        )


def totals(*, split: str = "") -> Totals:
    """What the queue holds, of one split or of all."""
    found = _of(split).filter(status__in=[state.status for state in STATES.values()])
    grouped_rows = found.order_by().values_list("status").annotate(n=Count("pk"), oldest_at=Min("queued_at"))
    by_status = {status: (n, oldest_at) for status, n, oldest_at in grouped_rows}
    counts = tuple(
        (name, state.heading, by_status.get(state.status, (0, None))[0]) for name, state in STATES.items()
    )
    _, oldest_at = by_status.get(Status.QUEUED, (0, None))
    age = duration((clock.database_now() - oldest_at).total_seconds()) if oldest_at else ""
    return Totals(counts=counts, oldest_age=age)


def queue_table(*, state: str = "", split: str = "", number: Any = 1) -> dict[str, Any]:
    """What the template places: the beginning of each list, or with `state` page `number` of that one.

    `seen` changes exactly when what is shown does.
    """
    counted, faults, now = totals(split=split), list(_faults()), clock.database_now()
    sections: list[dict[str, Any]] = []
    for name in [state] if state else STATES:
        paginator = Paginator(_listed(STATES[name], split=split), PER_PAGE if state else PER_SECTION)
        # Counted already, for all lists at once.
        paginator.count = next(n for each, _, n in counted.counts if each == name)
        page = paginator.get_page(number if state else 1)
        rows = [_row(each, STATES[name], now=now) for each in page]
        sections.append(
            {"name": name, "state": STATES[name], "n": paginator.count, "page": page, "rows": rows}
        )
    seen = repr((counted, faults, [(each["n"], each["page"].number, each["rows"]) for each in sections]))
    return {
        "totals": counted,
        "sections": sections,
        "faults": faults,
        "seen": hashlib.sha256(seen.encode()).hexdigest()[:16],
    }


def _of(split: str) -> QuerySet[Evaluation]:
    rows = Evaluation.objects.all()
    return rows.filter(submission__split=split) if split else rows


def _listed(state: State, *, split: str) -> QuerySet[Evaluation]:
    """One of the lists, without the columns that are large and not shown."""
    rows = Evaluation.objects.filter(status=state.status)
    rows = rows.order_by(*state.order, "pk") if state.order else rows.in_turn()
    rows = rows.filter(submission__split=split) if split else rows
    people = rows.select_related("submission__method__team", "submission__submitted_by", "edition")
    return people.defer("report", "problems")


def _row(evaluation: Evaluation, state: State, *, now: datetime) -> dict[str, Any]:
    """One evaluation. `until` is None where that moment is over, or there is none."""
    submission, is_running = evaluation.submission, state.status == Status.RUNNING
    # Running: the end of the lease; waiting: not to be begun before.
    until = evaluation.leased_until if is_running else evaluation.due_at
    return {
        "evaluation_id": evaluation.pk,
        "submission_id": submission.pk,
        "at": getattr(evaluation, state.since),
        "method": submission.method.name,
        "tag": ", ".join(_tags(evaluation)),
        "team": submission.method.team.name,
        "submitter": submission.submitted_by.email,
        "split": submission.split_id,
        "edition": evaluation.edition.number,
        "priority": _PRIORITIES.get(evaluation.priority, str(evaluation.priority)),
        "n_tries": evaluation.attempt,
        "strikes": strike_words(evaluation),
        # Its beginning tells claims apart; the whole is the right to decide.
        "claim": str(evaluation.lease_token)[:8] if is_running else "",
        "until": until if until and until > now else None,
        "error": evaluation.last_error,
    }


def _tags(evaluation: Evaluation) -> Iterable[str]:
    """Why scoring it may matter less, and that others do not see its method."""
    if evaluation.submission.method.visibility != Visibility.PUBLIC:
        yield evaluation.submission.method.get_visibility_display()
    if evaluation.submission.withdrawn_at:
        yield "withdrawn"
    if evaluation.edition.discarded_at:
        yield "edition discarded"


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
        yield f"There was no sweep in the last {health.MAX_SWEEP_AGE_S:.0f} s: every worker is gone."
    n_out_of_reach = health.n_out_of_reach()
    if n_out_of_reach:
        yield (
            f"{grouped(n_out_of_reach)} waiting evaluations need a ground truth that the worker of the last "
            "sweep could not read."
        )
