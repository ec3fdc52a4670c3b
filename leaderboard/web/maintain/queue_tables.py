"""Tables of the queue: system errors, running and waiting evaluations."""

import hashlib
from collections.abc import Iterable, Mapping
from datetime import datetime, timedelta
from typing import Any, Final, NamedTuple

from django.core.paginator import Paginator
from django.db.models import Count, Max, Min, QuerySet

from evaluator.counting import counted
from leaderboard.db import clock
from leaderboard.models import Evaluation, Status, Visibility
from leaderboard.ops import health
from leaderboard.queue.lifecycle import MAX_INFRASTRUCTURE_STRIKES, MAX_POISON_STRIKES
from leaderboard.web.formatting import duration, grouped

PER_PAGE: Final = 50
PER_SECTION: Final = 20


class State(NamedTuple):
    """One of three lists; without an order, its rows are in the workers' order."""

    status: Status
    heading: str
    order: tuple[str, ...] = ()


STATES: Final[Mapping[str, State]] = {
    "failed": State(Status.SYSTEM_ERROR, "System errors", ("-finished_at", "pk")),
    "running": State(Status.RUNNING, "Running", ("started_at", "pk")),
    "waiting": State(Status.QUEUED, "Waiting"),
}


def totals(*, split: str = "") -> dict[str, Any]:
    """Count each list, and return the longest waiting time."""
    queue = Evaluation.objects.filter(status__in=[state.status for state in STATES.values()])
    queue = queue.filter(submission__split=split) if split else queue
    rows = queue.order_by().values_list("status").annotate(n=Count("pk"), oldest_at=Min("queued_at"))
    by_status = {status: (n, oldest_at) for status, n, oldest_at in rows}
    counts = {name: by_status.get(state.status, (0, None))[0] for name, state in STATES.items()}
    _, oldest_at = by_status.get(Status.QUEUED, (0, None))
    age = clock.database_now() - oldest_at if oldest_at else timedelta()
    oldest_age = duration(age.total_seconds()) if oldest_at else ""
    failed = counted(counts["failed"], "system error") if counts["failed"] else ""
    return {
        "counts": counts,
        "n": sum(counts.values()),
        "facts": [fact for fact in (failed, oldest_age and f"oldest {oldest_age}") if fact],
        "oldest_age": oldest_age,
        "is_slow": age > health.MAX_QUEUE_AGE,
    }


def queue_table(*, state: str = "", split: str = "", number: Any = 1) -> dict[str, Any]:
    """Return the beginning of each list, or page `number` of one.

    `seen` changes when a row or a count does.
    """
    has_worker = health.has_recent_sweep()
    summary, faults, now = totals(split=split), list(_faults(has_worker=has_worker)), clock.database_now()
    finished_at = _last_finished_at(split=split)
    sections: list[dict[str, Any]] = []
    shown: list[object] = [summary, faults, finished_at]
    for name in [state] if state else STATES:
        paginator = Paginator(_listed(STATES[name], split=split), PER_PAGE if state else PER_SECTION)
        # Counted already, for all lists at once.
        paginator.count = summary["counts"][name]
        page = paginator.get_page(number if state else 1)
        rows = [(each, ", ".join(_tags(each)), strike_words(each), _until(each, now=now)) for each in page]
        heading, nothing = STATES[name].heading, nothing_words(name)
        sections.append({"name": name, "heading": heading, "nothing": nothing, "page": page, "rows": rows})
        shown += [page.number, *((row.pk, row.attempt, row.last_error, *more) for row, *more in rows)]
    return {
        **summary,
        "headings": [(name, each.heading, summary["counts"][name]) for name, each in STATES.items()],
        "sections": sections,
        "nothing": nothing_words(state),
        "faults": faults,
        "has_worker": has_worker,
        "max_age_s": f"{health.MAX_SWEEP_AGE_S:.0f}",
        "finished_at": finished_at,
        "seen": hashlib.sha256(repr(shown).encode()).hexdigest()[:16],
    }


def nothing_words(state: str) -> str:
    """Say that a list is empty, or all of them.

    >>> nothing_words("failed"), nothing_words("running"), nothing_words("")
    ('No system errors.', 'No running evaluations.', 'Nothing is waiting, running or failed.')
    """
    if not state:
        return "Nothing is waiting, running or failed."
    return "No system errors." if state == "failed" else f"No {state} evaluations."


def _listed(state: State, *, split: str) -> QuerySet[Evaluation]:
    # Without the columns that are large and not shown.
    rows = Evaluation.objects.filter(status=state.status)
    rows = rows.order_by(*state.order) if state.order else rows.in_turn()
    rows = rows.filter(submission__split=split) if split else rows
    people = rows.select_related(
        "submission__method__team", "submission__split", "submission__submitted_by", "edition"
    )
    return people.defer("report", "problems")


def _last_finished_at(*, split: str) -> datetime | None:
    decided = Evaluation.objects.filter(status__in=[Status.SCORED, Status.REJECTED])
    decided = decided.filter(submission__split=split) if split else decided
    last: datetime | None = decided.aggregate(last=Max("finished_at"))["last"]
    return last


def _until(evaluation: Evaluation, *, now: datetime) -> datetime | None:
    """Return the end of the lease, or the earliest start, if in the future."""
    is_running = evaluation.status == Status.RUNNING
    until = evaluation.leased_until if is_running else evaluation.due_at
    return until if until and until > now else None


def _tags(evaluation: Evaluation) -> Iterable[str]:
    if evaluation.submission.method.visibility != Visibility.PUBLIC:
        yield evaluation.submission.method.get_visibility_display()
    if evaluation.submission.withdrawn_at:
        yield "withdrawn"
    if evaluation.edition.discarded_at:
        yield "edition discarded"


def strike_words(evaluation: Evaluation) -> str:
    """Count failed runs by cause; empty if none failed.

    >>> strike_words(Evaluation(n_poison_strikes=2))
    '2 of 3 (file)'
    """
    strikes = (
        ("file", evaluation.n_poison_strikes, MAX_POISON_STRIKES),
        ("system", evaluation.n_infrastructure_strikes, MAX_INFRASTRUCTURE_STRIKES),
    )
    return ", ".join(f"{n} of {most} ({kind})" for kind, n, most in strikes if n)


def _faults(*, has_worker: bool) -> Iterable[str]:
    if not has_worker:
        yield f"No worker was seen in the last {health.MAX_SWEEP_AGE_S:.0f} s: nothing is evaluated."
    n_out_of_reach = health.n_out_of_reach()
    if n_out_of_reach:
        yield (
            f"{grouped(n_out_of_reach)} waiting evaluations need a ground truth that the worker of the last "
            "sweep could not read."
        )
