"""What a shell completes with the names that a leaderboard knows: splits, methods, columns.

A shell waits for it while somebody types, so the server is asked once and for two seconds at most; without an
answer there are no suggestions.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Final

import click
from click.shell_completion import CompletionItem

from evaluator.cli.failures import Failure
from evaluator.cli.options import DEFAULT_URL
from evaluator.cli.paths import server_of_login
from evaluator.cli.tokens import token_for
from evaluator.metrics.protocol import known_names

if TYPE_CHECKING:
    from evaluator.client.client import Client

TIMEOUT_S: Final = 2.0


def splits(context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
    """The splits of the leaderboard that begin so."""
    return _asked(context, incomplete, own=False)


def methods(context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
    """The methods of one's own team that begin so."""
    return _asked(context, incomplete, own=True)


def columns(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
    """The columns by which a board can be sorted."""
    names = ("rank", "method", "team", "date", *known_names())
    return [name for name in names if name.startswith(incomplete)]


def rows(context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
    """The methods on the board of the split that stands in the same line."""
    split = context.params.get("split") or "test"
    return _asked(context, incomplete, own=False, board=split)


def rows_or_files(
    context: click.Context, parameter: click.Parameter, incomplete: str
) -> list[str] | list[CompletionItem]:
    """The methods of the board; with ground truth in the line, files."""
    if context.params.get("truth_path"):
        return [CompletionItem(incomplete, type="file")]
    return rows(context, parameter, incomplete)


def _asked(context: click.Context, incomplete: str, *, own: bool, board: str = "") -> list[str]:
    from evaluator.client.answers import ClientError  # noqa: PLC0415 -- loads msgspec
    from evaluator.client.client import Client  # noqa: PLC0415 -- loads httpx, which --help can do without
    from evaluator.client.exchange import RetryPolicy  # noqa: PLC0415 -- the same

    url = context.params.get("url") or os.environ.get("TSTTC_URL") or server_of_login() or DEFAULT_URL
    once = RetryPolicy(n_tries=1, n_first_tries=1)
    try:
        token = token_for(url) if own else None
        with Client(url=url, token=token, timeout_s=TIMEOUT_S, patience=once) as client:
            names = _rows(client, board) if board else _methods(client) if own else client.splits()
    except (ClientError, Failure):  # nobody who completes a word wants to read of it
        return []
    return [name for name in names if name.startswith(incomplete)]


def _rows(client: Client, split: str) -> list[str]:
    return [entry.method for entry in client.board(split).entries]


def _methods(client: Client) -> list[str]:
    client.require_leaderboard()
    return [method.name for method in client.methods()]
