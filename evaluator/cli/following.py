"""Waiting for a submission: live on a terminal, one line for each state elsewhere."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import click

from evaluator.cli.layout import printable

if TYPE_CHECKING:
    from evaluator.answers import Submission
    from evaluator.client import Client


def followed(client: Client, submission_id: str, *, timeout_s: float) -> Submission:
    """The submission when it is final; until then standard error tells each state."""
    states = client.watch(submission_id, timeout_s=timeout_s)
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


def state_in_words(submission: Submission) -> str:
    """One line: the state, and for a waiting one how many are ahead and about how long that takes."""
    words = printable(submission.state)
    if submission.queue is not None and submission.state == "QUEUED":
        words += f", {submission.queue.ahead:,} ahead"
        if submission.queue.estimate_s is not None:
            words += f", about {submission.queue.estimate_s:.0f} s"
    return words
