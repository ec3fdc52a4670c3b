"""Waiting for a submission, and its state in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from evaluator.cli.layout import printable

if TYPE_CHECKING:
    from evaluator.client.answers import Submission
    from evaluator.client.client import Client


def followed(client: Client, submission_id: str, *, timeout_s: float) -> Submission:
    """The submission when it is final; until then standard error tells each state."""
    told = ""
    for submission in client.watch(submission_id, timeout_s=timeout_s):
        if submission.state != told and not submission.is_final:
            click.echo(state_in_words(submission), err=True)
            told = submission.state
    return submission


def state_in_words(submission: Submission) -> str:
    """One line: the state, and for a waiting one how many are ahead."""
    words = printable(submission.state)
    if submission.withdrawn_at:
        words += ", withdrawn"
    if submission.queue is not None and submission.state == "QUEUED":
        words += f", {submission.queue.ahead:,} ahead"
    return words
