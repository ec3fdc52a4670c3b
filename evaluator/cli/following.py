"""Waiting: for a submission, live on a terminal, by lines elsewhere; and signs of life in a pipe.

A terminal has bars and spinners; the log of a job has nothing but lines, and silence looks like a hang.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, TYPE_CHECKING, Final

import click

from evaluator.cli.layout import printable

if TYPE_CHECKING:
    from evaluator.client.answers import Submission
    from evaluator.client.client import Client

INTERVALS_WITHIN_S = 10.0


def followed(
    client: Client, submission_id: str, *, timeout_s: float, seen: Submission | None = None
) -> Submission:
    """The submission when it is final and has its intervals; until then standard error tells each state.

    `seen` is the server's answer of a moment ago, if there is one.
    Intervals are waited for a little while only: workers make them when no submission waits.
    """
    states = _states(client, submission_id, timeout_s=timeout_s, seen=seen)
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


def _states(
    client: Client, submission_id: str, *, timeout_s: float, seen: Submission | None
) -> Iterator[Submission]:
    """Every state seen, the last one final."""
    until_s = client.monotonic_s() + timeout_s
    for submission in client.watch(submission_id, timeout_s=timeout_s, seen=seen):
        yield submission
    if submission.awaits_intervals:
        left_s = min(INTERVALS_WITHIN_S, until_s - client.monotonic_s())
        yield client.settled(submission, timeout_s=left_s)


def state_in_words(submission: Submission) -> str:
    """One line: the state, and for a waiting one how many are ahead."""
    words = printable(submission.state)
    if submission.withdrawn_at:
        words += ", withdrawn"
    if submission.queue is not None and submission.state == "QUEUED":
        words += f", {submission.queue.ahead:,} ahead"
    return words


EVERY_S: Final = 5.0


@contextmanager
def signs_of_life(waiting_for: str, *, every_s: float = EVERY_S) -> Iterator[None]:
    """While this lasts, say every `every_s` seconds what the command waits for; not on a terminal."""
    if sys.stderr.isatty():
        yield
        return
    is_over = threading.Event()
    stream: IO[str] = sys.stderr

    def tell() -> None:
        n_told = 0
        while not is_over.wait(every_s):
            n_told += 1
            click.echo(f"Waiting for {waiting_for} ({n_told * every_s:.0f} s) …", file=stream)

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield
    finally:
        is_over.set()
        teller.join()
