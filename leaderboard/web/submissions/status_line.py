"""A submission's progress: its status line, what was truncated, and its problems."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Final, NamedTuple

from evaluator.problems import plain_pointer
from leaderboard.models import Evaluation, Status
from leaderboard.submissions.progress import Progress
from leaderboard.submissions.status_text import short_fault
from leaderboard.web.formatting import grouped

MAX_POINTS: Final = 20
INTERVALS_FOLLOW: Final = "confidence intervals follow"
LATE: Final = "Taking longer than usual; nothing is lost."
_ENDS: Final = {
    Status.SCORED: "Scored",
    Status.REJECTED: "Rejected",
    Status.SYSTEM_ERROR: "System error",
    Status.CANCELLED: "Cancelled",
}


@dataclass(frozen=True)
class Step:
    """A step of the line. `state` is "done", "now" or "ahead"."""

    label: str
    state: str
    at: datetime | None = None
    note: str = ""


class ShownProblem(NamedTuple):
    """A problem of a file: the fault in short, and the rest of its sentence."""

    fault: str
    rest: str
    where: str
    code: str


@dataclass(frozen=True)
class StateLine:
    """The status line. `seen` changes with it; `is_moving` pages poll."""

    steps: tuple[Step, ...]
    seen: str
    is_moving: bool
    truncation: str
    problems: tuple[ShownProblem, ...]
    listing: str


def state_line(
    progress: Progress, *, awaits_intervals: bool = False, withdrawn_at: datetime | None = None
) -> StateLine:
    """Make the status line. `awaits_intervals`: scored, and its intervals are expected."""
    more = "-intervals" if awaits_intervals else ""
    problems = tuple(_shown(problem) for problem in progress.problems[:MAX_POINTS])
    cut = f"; the first {MAX_POINTS} are listed" if len(progress.problems) > MAX_POINTS else ""
    is_whole = len(problems) == progress.n_problems
    return StateLine(
        steps=_with_withdrawal(steps(progress, awaits_intervals=awaits_intervals), withdrawn_at),
        seen=f"{progress.state}-{progress.n_ahead}-{progress.started_at}-{progress.is_late}{more}",
        is_moving=awaits_intervals or not progress.is_final,
        truncation=truncation(progress.truncated),
        problems=problems,
        listing="" if is_whole else f"Identical problems are grouped{cut}.",
    )


def _shown(problem: Mapping[str, str]) -> ShownProblem:
    message = problem["message"]
    fault = short_fault(message)
    return ShownProblem(
        fault, message[len(fault) :], plain_pointer(problem.get("where", "")), problem.get("code", "")
    )


def _with_withdrawal(shown: tuple[Step, ...], at: datetime | None) -> tuple[Step, ...]:
    # What was cancelled has that for its end already.
    if at is None or shown[-1].state != "now" or shown[-1].label == _ENDS[Status.CANCELLED]:
        return shown
    return (*shown[:-1], replace(shown[-1], state="done"), Step("Withdrawn", "now", at))


def steps(progress: Progress, *, awaits_intervals: bool = False) -> tuple[Step, ...]:
    """Return received → queued → running → the end; for another edition's run see `_again`."""
    if progress.first_run is not None:
        return _again(progress, progress.first_run, awaits_intervals=awaits_intervals)
    is_queued, is_running = progress.state == Status.QUEUED, progress.state == Status.RUNNING
    received = Step("Received", "done", progress.received_at)
    if is_queued:
        queue_position = f"{progress.n_ahead} ahead" if progress.n_ahead else "next in line"
        queued = Step("Queued", "now", progress.queued_at, LATE if progress.is_late else queue_position)
        return received, queued, Step("Running", "ahead"), Step("Scored", "ahead")
    queued = Step("Queued", "done", progress.queued_at)
    late = LATE if is_running and progress.is_late else ""
    running = Step("Running", "now" if is_running else "done", progress.started_at, late)
    if is_running:
        return received, queued, running, Step("Scored", "ahead")
    end = Step(
        _ENDS[Status(progress.state)],
        "now",
        progress.finished_at,
        INTERVALS_FOLLOW if awaits_intervals else "",
    )
    return (received, queued, running, end) if progress.started_at else (received, queued, end)


def _again(progress: Progress, first: Evaluation, *, awaits_intervals: bool) -> tuple[Step, ...]:
    """Return the end of the first run, then the run in the present edition."""
    received = Step("Received", "done", progress.received_at)
    before = Step(_ENDS[Status(first.status)], "done", first.finished_at, f"edition {first.edition.number}")
    now_in = f"edition {progress.edition_number}"
    if not progress.is_final:
        label = "Queued again" if progress.state == Status.QUEUED else "Running again"
        at = progress.queued_at if progress.state == Status.QUEUED else progress.started_at
        return received, before, Step(label, "now", at, now_in), Step("Re-scored", "ahead")
    label = "Re-scored" if progress.state == Status.SCORED else _ENDS[Status(progress.state)]
    note = f"{now_in}, {INTERVALS_FOLLOW}" if awaits_intervals else now_in
    return received, before, Step(label, "now", progress.finished_at, note)


def truncation(truncated: Mapping[str, int]) -> str:
    """Say how many predictions were truncated at each boundary.

    >>> truncation({"-20": 0, "0.05": 1, "20": 1200})
    '1,201 predictions were outside the allowed range and were truncated: 1 at 0.05 s, 1,200 at 20 s.'
    """
    moved = {boundary: n for boundary, n in truncated.items() if n}
    n_moved = sum(moved.values())
    if not moved:
        return "Nothing was truncated."
    parts = [f"{grouped(n)} at {boundary.replace('-', '−')} s" for boundary, n in moved.items()]
    subject = "1 prediction" if n_moved == 1 else f"{grouped(n_moved)} predictions"
    verb = "was" if n_moved == 1 else "were"
    return f"{subject} {verb} outside the allowed range and {verb} truncated: {', '.join(parts)}."
