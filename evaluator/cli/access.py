"""The subcommands about one's own account: login, logout, quota, publish."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import click

from evaluator.cli.connection import connect
from evaluator.cli.exits import Exit
from evaluator.cli.failures import Failure, echo_json
from evaluator.cli.layout import NO_VALUE, Cell, aligned, printable
from evaluator.cli.options import TOKEN_VARIABLE, json_option, sendable, slug, url_option
from evaluator.cli.places import keep_server_of_login, server_of_login
from evaluator.cli.tokens import account, checked, forget_token, keep_token, required_keyring

if TYPE_CHECKING:
    from evaluator.answers import Foreseen, Quota

N_MOVED_TOLD = 5  # rows whose rank changes; the first show what the others do


@click.command(short_help="Keep a token in the keyring of this machine.")
@url_option
@json_option
def login(*, url: str, as_json: bool) -> None:
    """Keep a token in the operating system's keyring, once the server has accepted it.

    The token is asked for, without showing it, or read from standard input. Other commands then find it, and
    this leaderboard, by themselves. TSTTC_TOKEN, where it is set, comes before it. Make a token at /tokens/.

    \b
    Examples:
      tsttc login --server https://leaderboard.example.org
      pass show tsttc | tsttc login --server https://leaderboard.example.org
    """
    required_keyring()  # before anybody types in vain
    token = checked(_asked(url), named="What was given")
    with connect(url, with_token=True, token=token) as client:
        client.quota()  # answered to every token, whatever else it is good for
    keyring = keep_token(url, token)
    try:
        keep_server_of_login(url)
    except OSError as error:
        click.echo(f"The address could not be kept ({error.strerror}); name it with --server.", err=True)
    if as_json:
        echo_json({"server": url, "keyring": keyring})
        return
    click.echo(f"The token is good, and kept for {url} ({printable(keyring)}).")


@click.command(short_help="Remove the token from the keyring.")
@url_option
@json_option
def logout(*, url: str, as_json: bool) -> None:
    """Remove the token for a leaderboard from the keyring of this machine.

    The token itself stays good until it ends or is revoked, which is done at /tokens/ of the leaderboard.

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
        click.echo(
            f"The token for {url} is removed from this machine. End it for good at {url.rstrip('/')}/tokens/"
        )
    else:
        click.echo(f"There was no token for {url} in a keyring of this machine.")


@click.command(short_help="Show how many submissions your team has left.")
@click.argument("split", required=False, callback=lambda c, p, value: value and slug(c, p, value))
@url_option
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
    if split is not None:
        rows = [row for row in rows if row.split == split]
        if not rows:
            raise Failure(
                f"The server names no quota for {split!r}; expected one of its splits.",
                exit_code=Exit.REFUSED,
                code="unknown-split",
                hint="See all with: tsttc quota",
            )
    if as_json:
        echo_json([row.document for row in rows] if split is None else rows[0].document)
        return
    for line in _quota_in_words(rows):
        click.echo(line)


@click.command(short_help="Show one of your methods to everybody.")
@click.argument("method", callback=sendable)
@click.option(
    "--as",
    "visibility",
    type=click.Choice(["public", "anonymous"]),
    default="public",
    show_default=True,
    help="With its name and team, or under a pseudonym.",
)
@click.option(
    "--reveal-at",
    metavar="MOMENT",
    callback=sendable,
    help="With --as anonymous: when it turns public by itself, such as 2027-03-01T00:00:00Z.",
)
@click.option("--yes", is_flag=True, help="Do not ask; a job without a terminal has to say so.")
@url_option
@json_option
def publish(
    *, method: str, visibility: str, reveal_at: str | None, yes: bool, url: str, as_json: bool
) -> None:
    """Show METHOD, the name or id of one of your own, to everybody. Public is for ever.

    New methods are private: only your team sees them on the boards. An anonymous one shows its numbers under
    a pseudonym, and can be made public later. Before it asks, it shows what everybody will see.

    \b
    Examples:
      tsttc publish "Foo++"
      tsttc publish "Foo++" --as anonymous --reveal-at 2027-03-01T00:00:00Z --yes
    """
    if reveal_at and visibility == "public":
        raise click.UsageError(
            "A public method has no date of reveal: --reveal-at belongs to --as anonymous."
        )
    with connect(url, with_token=True) as client:
        found = client.own_method(method)
        if found is None:
            raise Failure(
                f"Your team has no method {printable(method)!r}; expected the name or id of one of yours.",
                exit_code=Exit.USAGE,
                code="unknown-method",
            )
        if not yes:
            _confirm(found.name, visibility, client.foreseen(found.id, visibility.upper()))
        shown = client.show_method(found.id, visibility.upper(), reveal_at=reveal_at)
    if as_json:
        echo_json(shown.document)
        return
    called = f', and called "{shown.pseudonym}"' if visibility == "anonymous" and shown.pseudonym else ""
    until = f" until {shown.reveal_at}" if shown.reveal_at else ""
    address = f": {shown.url}" if shown.url else ""
    click.echo(printable(f"{found.name} is {visibility} now{called}{until}{address}"))


def _confirm(name: str, visibility: str, foreseen: Foreseen) -> None:
    """Show what others will see, and ask; where nobody can be asked, say so."""
    for line in _foreseen_in_words(foreseen):
        click.echo(line, err=True)
    meaning = {
        "public": "with its name, team and scores, for ever: it can be withdrawn, not hidden again",
        "anonymous": "its scores under a pseudonym, without name and team",
    }[visibility]
    words = f"This shows {printable(name)} to everybody, {meaning}."
    if not sys.stdin.isatty():
        raise Failure(
            words,
            exit_code=Exit.USAGE,
            code="not-confirmed",
            hint="Nothing was changed. Say --yes if it is meant.",
            more={"preview": foreseen.document},
        )
    click.echo(words, err=True)
    if not click.confirm("Go on?", err=True):
        raise Failure("Nothing was changed.", exit_code=Exit.USAGE, code="not-confirmed")


def _foreseen_in_words(foreseen: Foreseen) -> Iterator[str]:
    """What everybody would see: the rows that it would have, and whose ranks would change."""
    from evaluator.cli.values import texts_of  # noqa: PLC0415 -- the commands about tokens need no scores

    yield printable(f"Everybody will see {foreseen.name}, team {foreseen.team}:")
    table = [[Cell(text, is_bold=True) for text in ("split", "rank", "of", "MiD", "RTE", "now")]]
    for sight in foreseen.splits:
        ranks = [NO_VALUE if rank is None else f"{rank:,}" for rank in (sight.after.rank, sight.n_ranked)]
        values = texts_of(sight.after, missing=NO_VALUE, scores=("mid", "rte"))
        now = f"seen as {sight.before.method}" if sight.before else "not seen"
        table.append([Cell(printable(text)) for text in (sight.split, *ranks, *values, now)])
    if foreseen.splits:
        yield from aligned(table, align="<>>..<")
    else:
        yield "It has no scored submission on a board yet. What it scores from then on is seen at once."
    for sight in foreseen.splits:
        if sight.moved:
            told = [
                f"{row.method} {row.rank_before} to {row.rank_after}" for row in sight.moved[:N_MOVED_TOLD]
            ]
            rest = len(sight.moved) - len(told)
            more = f", and {rest:,} more" if rest else ""
            yield printable(f"On {sight.split} other ranks change: {', '.join(told)}{more}.")
    yield ""


def _asked(url: str) -> str:
    """The token from a terminal, which does not show it, or from standard input."""
    if not sys.stdin.isatty():
        return sys.stdin.readline()
    click.echo(f"Make a token at {url.rstrip('/')}/tokens/ and paste it here; it is not shown.", err=True)
    text: str = click.prompt("Token", hide_input=True, err=True)
    return text


def _quota_in_words(rows: Sequence[Quota]) -> Iterator[str]:
    table = [[Cell(text, is_bold=True) for text in ("split", "left", "of", "next slot")]]
    for row in rows:
        limit = "any number" if row.limit is None else f"{row.limit:,}"
        left = NO_VALUE if row.left is None else f"{row.left:,}"
        opens = "now" if row.is_open else row.next_slot_at or "never"
        table.append([Cell(printable(text)) for text in (row.split, left, limit, opens)])
    yield from aligned(table, align="<>><")
    said = [f"{row.split}: {row.sentence}" for row in rows if row.sentence and not row.is_open]
    if said:
        yield ""
        yield from map(printable, said)


__all__ = ["TOKEN_VARIABLE", "login", "logout", "publish", "quota"]
