"""The subcommands about what is one's own: whoami, methods, submissions, withdraw, download."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from evaluator.cli.connection import connect
from evaluator.cli.exits import Exit
from evaluator.cli.failures import Failure, echo_json
from evaluator.cli.layout import NO_VALUE, Cell, aligned, printable, short_name
from evaluator.cli.options import default_option, json_option, output_option, sendable, site_options, slug
from evaluator.cli.reading import write_bytes
from evaluator.cli.values import state_in_words
from evaluator.metrics.protocol import metric_of, primary_of, primary_value

if TYPE_CHECKING:
    from evaluator.client.answers import Submission


@click.command(short_help="Show whose token this is, and what it may do.")
@site_options
@json_option
def whoami(*, url: str, as_json: bool) -> None:
    """Show the team of your token, the token's name, what it may do and when it ends.

    \b
    Example:
      tsttc whoami
    """
    with connect(url, with_token=True) as client:
        account = client.account()
    if as_json:
        echo_json(account.document)
        return
    team = f"team {account.team}" if account.team else "no team yet"
    limit = f", for {account.split} only" if account.split else ""
    moment = account.expires_at
    end = f"until {moment[:16].replace('T', ' ')} UTC" if moment else "without an end"
    click.echo(printable(f"{team} at {url.rstrip('/')}"))
    name = "session of a browser" if account.token is None else f'token "{account.token}"'
    click.echo(printable(f"{name}: {', '.join(account.scopes)}{limit}, {end}"))


@click.command(short_help="List the methods of your team.")
@site_options
@json_option
def methods(*, url: str, as_json: bool) -> None:
    """List the methods of your team: id, name and who sees them.

    \b
    Example:
      tsttc methods
    """
    with connect(url, with_token=True) as client:
        own_methods = list(client.methods())
    if as_json:
        echo_json([method.document for method in own_methods])
        return
    if not own_methods:
        click.echo("Your team has no methods yet; tsttc submit creates one.")
        return
    table = [[Cell(text, is_bold=True) for text in ("id", "method", "visibility")]]
    for method in own_methods:
        called = f" as {method.pseudonym}" if method.visibility == "ANONYMOUS" and method.pseudonym else ""
        seen = f"{method.visibility.lower()}{called}"
        table.append([Cell(printable(text)) for text in (method.id, method.name, seen)])
    for line in aligned(table, align="<<<"):
        click.echo(line)


@click.command("submissions", short_help="List the submissions of your team, newest first.")
@click.option(
    "--split",
    callback=lambda c, p, value: value and slug(c, p, value),
    help="Only this split.",
)
@click.option(
    "--method",
    callback=sendable,
    help="Only this method, by name or id.",
)
@default_option(
    "-n", "--limit", type=click.IntRange(min=1), default=20, help="Largest number of submissions."
)
@site_options
@json_option
def list_submissions(*, split: str | None, method: str | None, limit: int, url: str, as_json: bool) -> None:
    """List the submissions of your team: id, time, split, method, state and the score that ranks.

    \b
    Examples:
      tsttc submissions
      tsttc submissions --split val --method "Foo++" --json | jq -r .[].id
    """
    with connect(url, with_token=True) as client:
        wanted = (
            each
            for each in client.submissions()
            if split in {None, each.split} and method in {None, each.method, each.method_id}
        )
        submissions = list(itertools.islice(wanted, limit))
    if as_json:
        echo_json([submission.document for submission in submissions])
        return
    if not submissions:
        click.echo(
            "Your team has no submissions yet." if split is method is None else "There are none of these."
        )
        return
    for line in _table(submissions):
        click.echo(line)


def _table(submissions: Sequence[Submission]) -> list[str]:
    from evaluator.scoring.results import format_rounded  # noqa: PLC0415 -- loads numpy, which --help can do without

    ranking = dict.fromkeys(primary_of(each.scores) for each in submissions if each.scores)
    heads = ("id", "submitted", "split", "method", "state", ", ".join(map(short_name, ranking)) or "score")
    table = [[Cell(text, is_bold=True) for text in heads]]
    for each in submissions:
        value = format_rounded(primary_value(each.scores), decimals=each.decimals, missing=NO_VALUE)
        if each.scores and len(ranking) > 1:  # of boards that rank by different metrics
            value = f"{metric_of(primary_of(each.scores)).symbol} {value}"
        texts = (
            each.id,
            str(each.document.get("submitted_at", ""))[:16].replace("T", " "),
            each.split,
            each.method,
            state_in_words(each),
            value,
        )
        table.append([Cell(printable(text)) for text in texts])
    return aligned(table, align="<<<<<.")


@click.command(short_help="Withdraw or cancel a submission of your team.")
@click.argument("submission_id", metavar="ID", callback=slug)
@click.option("--yes", is_flag=True, help="Do not ask for confirmation; required without a terminal.")
@site_options
@json_option
def withdraw(*, submission_id: str, yes: bool, url: str, as_json: bool) -> None:
    """Withdraw submission ID. This cannot be undone.

    A waiting submission is cancelled. A submission on a board leaves a row that is marked as withdrawn.

    \b
    Example:
      tsttc withdraw 1f0c6a2e-6d0b-4f3e-9c55-0d4f2b8f3a11
    """
    with connect(url, with_token=True) as client:
        submission = client.submission(submission_id)
        named = printable(f"{submission.method} on {submission.split}")
        if not yes:
            _confirm(f"This withdraws {named}, state {submission.state}; it cannot be undone.")
        done = client.withdraw(submission_id)
    if as_json:
        echo_json(done.document)
        return
    click.echo(f"{named} is {'cancelled' if done.state == 'CANCELLED' else 'withdrawn'}.")


def _confirm(words: str) -> None:
    if not sys.stdin.isatty():
        hint = "Nothing was changed. Use --yes to confirm."
        raise Failure(words, exit_code=Exit.USAGE, code="not-confirmed", hint=hint)
    click.echo(words, err=True)
    if not click.confirm("Withdraw?", err=True):
        raise Failure("Nothing was changed.", exit_code=Exit.USAGE, code="not-confirmed")


@click.command(short_help="Move a submission to another method of your team.")
@click.argument("submission_id", metavar="ID", callback=slug)
@click.option("--method", callback=sendable, required=True, help="Name or id of another private method.")
@site_options
@json_option
def move(*, submission_id: str, method: str, url: str, as_json: bool) -> None:
    """Move submission ID to another method of your team. Both methods have to be private.

    \b
    Example:
      tsttc move 1f0c6a2e-6d0b-4f3e-9c55-0d4f2b8f3a11 --method "Foo++"
    """
    with connect(url, with_token=True) as client:
        moved = client.move(submission_id, method=method)
    if as_json:
        echo_json(moved.document)
        return
    click.echo(printable(f"The submission to {moved.split} is now one of {moved.method}."))


@click.command(short_help="Get back a prediction file that your team submitted.")
@click.argument("submission_id", metavar="ID", callback=slug)
@output_option("it")
@site_options
def download(*, submission_id: str, output: Path | None, url: str) -> None:
    """Get the file of submission ID, byte by byte as your team submitted it.

    \b
    Example:
      tsttc download 1f0c6a2e-6d0b-4f3e-9c55-0d4f2b8f3a11 -o predictions.json
    """
    with connect(url, with_token=True) as client:
        data = client.file(submission_id)
    if output is None:
        click.echo(data, nl=False)
        return
    write_bytes(output, data)
    click.echo(f"{output}: {len(data):,} bytes.")
