"""Waiting for a submission: live on a terminal, one line for each state elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING

import click

from evaluator.cli.layout import printable

if TYPE_CHECKING:
    from evaluator.client.answers import Submission
    from evaluator.client.client import Client

INTERVALS_WITHIN_S = 10.0


def followed(client: Client, submission_id: str, *, timeout_s: float) -> Submission:
    """The submission when it is final and has its intervals; until then standard error tells each state.

    Intervals are waited for a little while only: workers make them when no submission waits.
    """
    states = _states(client, submission_id, timeout_s=timeout_s)
    if sys.stderr.isatty():
        from rich.console import Console  # noqa: PLC0415 -- only a terminal needs it
        from rich.live import Live  # noqa: PLC0415 -- as above
        from rich.spinner import Spinner  # noqa: PLC0415 -- as above
        from rich.text import Text  # noqa: PLC0415 -- as above

        with Live(console=Console(stderr=True), transient=True) as line:
            for submission in states:
                line.update(Spinner("dots", Text(state_in_words(submission))), refresh=True)
        return submission
    told = ""
    for submission in states:
        if submission.state != told and not submission.is_final:
            click.echo(state_in_words(submission), err=True)
            told = submission.state
    return submission


def _states(client: Client, submission_id: str, *, timeout_s: float) -> Iterator[Submission]:
    """Every state seen, the last one final."""
    until_s = client.monotonic_s() + timeout_s
    for submission in client.watch(submission_id, timeout_s=timeout_s):
        yield submission
    if submission.awaits_intervals:
        left_s = min(INTERVALS_WITHIN_S, until_s - client.monotonic_s())
        yield client.settled(submission, timeout_s=left_s)


def state_in_words(submission: Submission) -> str:
    """One line: the state, and for a waiting one how many are ahead and about how long that takes."""
    words = printable(submission.state)
    if submission.withdrawn_at:
        words += ", withdrawn"
    if submission.queue is not None and submission.state == "QUEUED":
        words += f", {submission.queue.ahead:,} ahead"
        if submission.queue.estimate_s is not None:
            words += f", about {submission.queue.estimate_s:.0f} s"
    return words
