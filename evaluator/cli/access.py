"""The subcommands about one's own account: login, logout, quota, publish."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

import click

from evaluator.cli.connection import connect, unknown_split
from evaluator.cli.exits import Exit
from evaluator.cli.failures import Failure, echo_json
from evaluator.cli.layout import NO_VALUE, Cell, aligned, printable, short_name
from evaluator.cli.options import (
    default_option,
    json_option,
    sendable,
    site_options,
    slug,
    tokens_page,
    url_option,
)
from evaluator.cli.paths import keep_server_of_login, server_of_login
from evaluator.cli.tokens import account, checked, forget_token, keep_token

if TYPE_CHECKING:
    from evaluator.client.answers import Quota, VisibilityPreview

N_MOVED_SHOWN = 5  # rows whose rank changes; the first show what the others do


@click.command(short_help="Save a token on this machine.")
@site_options
@json_option
def login(*, url: str, as_json: bool) -> None:
    """Save a token in the keyring of the operating system, after the server has accepted it.

    Without a keyring, as on most servers, it goes into a file that only you can read. The command prompts for
    the token without showing it, or reads it from standard input. Other commands then use the token and this
    leaderboard. TSTTC_TOKEN, and the file that TSTTC_TOKEN_FILE names, take precedence if set. Create a token
    at /tokens/.

    \b
    Examples:
      tsttc login --server https://leaderboard.example.org
      pass show tsttc | tsttc login --server https://leaderboard.example.org
    """
    token = checked(_asked(url), named="What was given")
    with connect(url, with_token=True, token=token) as client:
        client.quota()  # answered to every token, whatever else it is good for
    keyring = keep_token(url, token)
    try:
        keep_server_of_login(url)
    except OSError as error:
        click.echo(f"The address could not be saved ({error.strerror}); name it with --server.", err=True)
    if as_json:
        echo_json({"server": url, "keyring": keyring})
        return
    click.echo(f"The token is valid and saved for {url} ({printable(keyring)}).")


@click.command(short_help="Remove the token from this machine.")
@url_option
@json_option
def logout(*, url: str, as_json: bool) -> None:
    """Remove the token for a leaderboard from this machine.

    The token stays valid until it expires or you revoke it at /tokens/ of the leaderboard.

    \b
    Example:
      tsttc logout
    """
    was_kept = forget_token(url)
    if account(server_of_login() or "") == account(url):
        keep_server_of_login(None)
    if as_json:
        echo_json({"server": url, "was_kept": was_kept})
    elif was_kept:
        click.echo(f"The token for {url} is removed from this machine. Revoke it at {tokens_page(url)}")
    else:
        click.echo(f"There was no token for {url} on this machine.")


@click.command(short_help="Show how many submissions your team has left.")
@click.argument(
    "split",
    required=False,
    callback=lambda c, p, value: value and slug(c, p, value),
)
@site_options
@json_option
def quota(*, split: str | None, url: str, as_json: bool) -> None:
    """Show how many submissions your team has left on each split, or on SPLIT, and when the next slot opens.

    \b
    Examples:
      tsttc quota
      tsttc quota test --json | jq .left
    """
    with connect(url, with_token=True) as client:
        rows = client.quota()
    names = [row.split for row in rows]
    if split is not None:
        rows = [row for row in rows if row.split == split]
        if not rows:
            raise unknown_split(names)
    if as_json:
        echo_json([row.document for row in rows] if split is None else rows[0].document)
        return
    for line in _quota_in_words(rows):
        click.echo(line)


@click.command(short_help="Publish one of your methods.")
@click.argument("method", callback=sendable)
@default_option(
    "--as",
    "visibility",
    type=click.Choice(["public", "anonymous"]),
    default="public",
    help="Publish with name and team, or under a pseudonym.",
)
@click.option(
    "--reveal-at",
    metavar="MOMENT",
    callback=sendable,
    help="With --as anonymous: when the method becomes public automatically, such as 2027-03-01T00:00:00Z.",
)
@click.option("--yes", is_flag=True, help="Do not ask for confirmation; required without a terminal.")
@site_options
@json_option
def publish(
    *, method: str, visibility: str, reveal_at: str | None, yes: bool, url: str, as_json: bool
) -> None:
    """Publish METHOD, the name or id of a method of your team. This cannot be undone.

    The token needs the scope publish, which a new token has only if you tick it.

    New methods are private: only your team and the maintainers see them. An anonymous method shows its
    scores under a pseudonym and can become public later. The command shows a preview before it asks for
    confirmation.

    \b
    Examples:
      tsttc publish "Foo++"
      tsttc publish "Foo++" --as anonymous --reveal-at 2027-03-01T00:00:00Z --yes
    """
    if reveal_at and visibility == "public":
        raise click.UsageError(
            "With --as public, the method becomes public at once; use --reveal-at only with --as anonymous."
        )
    with connect(url, with_token=True) as client:
        own_method = client.own_method(method)
        if own_method is None:
            raise Failure(
                f"Your team has no method {printable(method)!r}; expected the name or id of one of yours.",
                exit_code=Exit.USAGE,
                code="unknown-method",
            )
        if not yes:
            _confirm(
                own_method.name, visibility, client.visibility_preview(own_method.id, visibility.upper())
            )
        shown = client.show_method(own_method.id, visibility.upper(), reveal_at=reveal_at)
    if as_json:
        echo_json(shown.document)
        return
    called = f', and called "{shown.pseudonym}"' if visibility == "anonymous" and shown.pseudonym else ""
    until = f" until {shown.reveal_at}" if shown.reveal_at else ""
    address = f": {shown.url}" if shown.url else ""
    click.echo(printable(f"{own_method.name} is {visibility} now{called}{until}{address}"))


def _confirm(name: str, visibility: str, preview: VisibilityPreview) -> None:
    for line in _preview_in_words(preview):
        click.echo(line, err=True)
    meaning = {
        "public": "with its name, team and scores; this cannot be undone",
        "anonymous": "with its scores under a pseudonym, without name and team; this cannot be undone",
    }[visibility]
    words = f"This publishes {printable(name)}, {meaning}."
    if not sys.stdin.isatty():
        raise Failure(
            words,
            exit_code=Exit.USAGE,
            code="not-confirmed",
            hint="Nothing was changed. Use --yes to confirm.",
            more={"preview": preview.document},
        )
    click.echo(words, err=True)
    if not click.confirm("Publish?", err=True):
        raise Failure("Nothing was changed.", exit_code=Exit.USAGE, code="not-confirmed")


def _preview_in_words(preview: VisibilityPreview) -> Iterator[str]:
    from evaluator.cli.values import overall_of, texts_of  # noqa: PLC0415 -- others here need no scores

    yield printable(f"Everyone will see {preview.name}, team {preview.team}:")
    errors = overall_of(name for board in preview.splits for name in board.after.scores)
    headings = ("split", "rank", "of", *map(short_name, errors), "now")
    table = [[Cell(text, is_bold=True) for text in headings]]
    for board in preview.splits:
        ranks = [NO_VALUE if rank is None else f"{rank:,}" for rank in (board.after.rank, board.n_ranked)]
        values = texts_of(board.after, missing=NO_VALUE, scores=errors)
        now = f"visible as {board.before.method}" if board.before else "not visible"
        table.append([Cell(printable(text)) for text in (board.split, *ranks, *values, now)])
    if preview.splits:
        yield from aligned(table, align=f"<>>{'.' * len(errors)}<")
    else:
        yield "The method has no scored submission on a board yet."
    for board in preview.splits:
        if board.moved:
            moves = [
                f"{row.method} {row.rank_before} to {row.rank_after}" for row in board.moved[:N_MOVED_SHOWN]
            ]
            rest = len(board.moved) - len(moves)
            more = f", and {rest:,} more" if rest else ""
            yield printable(f"On {board.split} other ranks change: {', '.join(moves)}{more}.")
    yield ""


def _asked(url: str) -> str:
    """Ask for the token at a terminal, without echo, or read it from standard input."""
    if not sys.stdin.isatty():
        return sys.stdin.readline()
    click.echo(f"Create a token at {tokens_page(url)} and paste it here; the input is hidden.", err=True)
    text: str = click.prompt("Token", hide_input=True, err=True)
    return text


def _minute(moment: str | None) -> str:
    """A time of the server in the words of its sentences: the minute in which it has passed."""
    try:
        at = datetime.fromisoformat(moment or "").astimezone(UTC)
    except ValueError:
        return moment or ""
    if at.second or at.microsecond:
        at = at.replace(second=0, microsecond=0) + timedelta(minutes=1)
    return f"{at:%Y-%m-%d %H:%M} UTC"


def _quota_in_words(rows: Sequence[Quota]) -> Iterator[str]:
    table = [[Cell(text, is_bold=True) for text in ("split", "left", "of", "next slot")]]
    for row in rows:
        limit = "any number" if row.limit is None else f"{row.limit:,}"
        left = NO_VALUE if row.left is None else f"{row.left:,}"
        opens = "now" if row.is_open else _minute(row.next_slot_at) or "closed"
        table.append([Cell(printable(text)) for text in (row.split, left, limit, opens)])
    yield from aligned(table, align="<>><")
    sentences = [f"{row.split}: {row.sentence}" for row in rows if row.sentence and not row.is_open]
    if sentences:
        yield ""
        yield from map(printable, sentences)
