"""The subcommands about a submission: submit sends one, status asks after one."""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO
from urllib.parse import urljoin

import click

from evaluator.cli.connection import connect
from evaluator.cli.failures import FILE_AT_FAULT, SERVER, Failure, echo_json, n_problems_in_words
from evaluator.cli.layout import printable, result_in_words
from evaluator.cli.options import (
    is_utf8,
    json_option,
    predictions_argument,
    sendable,
    slug,
    timeout_option,
    url_option,
)

if TYPE_CHECKING:
    from evaluator.answers import Submission
    from evaluator.client import Client


@click.command(short_help="Send a prediction file to the leaderboard.")
@predictions_argument
@click.option("--split", required=True, callback=slug, help="The split that it predicts: val, test, …")
@click.option(
    "--method", callback=sendable, required=True, help="Name of the method; a new name makes a new one."
)
@click.option("--description", callback=sendable, help="One sentence about the method.")
@click.option("--paper-url", callback=sendable, metavar="URL", help="Where the paper is.")
@click.option("--code-url", callback=sendable, metavar="URL", help="Where the code is.")
@click.option("--note", callback=sendable, help="A remark for yourself, shown beside the submission.")
@click.option("--commit", callback=sendable, help="The commit that produced the file.")
@click.option("--wait", is_flag=True, help="Wait for the scores.")
@timeout_option
@url_option
@json_option
def submit(
    *,
    predictions: Path,
    split: str,
    method: str,
    wait: bool,
    timeout_s: float,
    url: str,
    as_json: bool,
    **details: str | None,
) -> None:
    """Send PREDICTIONS, a JSON file or - for standard input, to the leaderboard.

    The token is read from the environment variable TSTTC_TOKEN. Sending the same file again is
    harmless: the server answers with the first submission.

    \b
    Examples:
      tsttc submit predictions.json --split val --method "Foo++" --wait
      tsttc submit predictions.json --split test --method "Foo++" --wait --json > scores.json
    """
    with connect(url, with_token=True) as client, _opened(predictions) as file:
        submission = client.submit(
            file,
            filename=_name_to_send(predictions),
            split=split,
            method=method,
            details={field: value for field, value in details.items() if value},
        )
        if wait or not as_json:
            _announce(submission, site=url, err=as_json)
        if wait and not submission.is_final:
            submission = _followed(client, submission.id, timeout_s=timeout_s)
    _conclude(submission, as_json=as_json)


@click.command(short_help="Show the state, the scores or the problems of a submission.")
@click.argument("submission_id", metavar="ID", callback=slug)
@click.option("--watch", is_flag=True, help="Wait until the state is final.")
@timeout_option
@url_option
@json_option
def status(*, submission_id: str, watch: bool, timeout_s: float, url: str, as_json: bool) -> None:
    """Show the state of submission ID: its place in the queue, its scores, or what is wrong in the file.

    The token is read from the environment variable TSTTC_TOKEN.

    \b
    Example:
      tsttc status 1f0c6a2e-6d0b-4f3e-9c55-0d4f2b8f3a11 --watch
    """
    with connect(url, with_token=True) as client:
        submission = (
            _followed(client, submission_id, timeout_s=timeout_s)
            if watch
            else client.submission(submission_id)
        )
    _conclude(submission, as_json=as_json)


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    """The file to send. What can be read only once is kept first, so that sending can be repeated."""
    try:
        source = nullcontext(sys.stdin.buffer) if str(path) == "-" else path.open("rb")
        with source as file, tempfile.TemporaryFile() as kept:
            if not file.seekable():
                shutil.copyfileobj(file, kept)
            yield file if file.seekable() else kept
    except OSError as error:
        raise click.BadParameter(f"{path} cannot be read: {error.strerror}.") from None


def _name_to_send(path: Path) -> str:
    return path.name if str(path) != "-" and is_utf8(path.name) else "predictions.json"


def _followed(client: Client, submission_id: str, *, timeout_s: float) -> Submission:
    """The submission when it is final; until then standard error tells each state, live on a terminal."""
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
    if submission.queue is not None:
        words += f", {submission.queue.ahead:,} ahead"
        if submission.queue.estimate_s is not None:
            words += f", about {submission.queue.estimate_s:.0f} s"
    return words


def _announce(submission: Submission, *, site: str, err: bool) -> None:
    """Name the submission before waiting for it, so that an interrupted command leaves something to go on."""
    address = f"  {urljoin(site, submission.url)}" if submission.url else ""
    click.echo(printable(f"Submission {submission.id}{address}"), err=err)
    if not submission.is_new:
        click.echo("This file was sent before; this is its first submission.", err=err)


def _conclude(submission: Submission, *, as_json: bool) -> None:
    """Print what is known of a submission; raises Failure when it ended without scores."""
    named = (
        f"{submission.method} on {submission.split}" if submission.method else f"submission {submission.id}"
    )
    match submission.state:
        case "REJECTED":
            n_problems = submission.n_problems or len(submission.problems)
            message, exit_code = f"The file is rejected: {n_problems_in_words(n_problems)}.", FILE_AT_FAULT
            hint = "It does not count against your quota. Check a corrected file with: tsttc check"
        case "SYSTEM_ERROR":
            message, exit_code = f"The server failed to score {named}. The fault is not the file's.", SERVER
            hint = "It does not count against your quota."
        case "CANCELLED":
            message, exit_code, hint = f"{named} was cancelled, so it has no scores.", SERVER, ""
        case _:
            _show(submission, named=named, as_json=as_json)
            return
    raise Failure(
        message,
        exit_code=exit_code,
        code=submission.state.lower().replace("_", "-"),
        problems=submission.problems,
        hint=hint,
        document=submission.document,
    )


def _show(submission: Submission, *, named: str, as_json: bool) -> None:
    if as_json:
        echo_json(submission.document)
        return
    click.echo(f"{state_in_words(submission)}: {printable(named)}")
    if submission.scores is None:
        return
    click.echo("")
    for line in result_in_words(
        submission.scores,
        counts=submission.counts or {},
        n_out_of_range=submission.n_out_of_range or 0,
        truncated=submission.truncated or {},
    ):
        click.echo(line)
