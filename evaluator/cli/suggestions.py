"""What a shell completes with the names that a leaderboard knows: splits, and one's own methods.

A shell waits for it while somebody types, so the server is asked once and for two seconds at most; without an
answer there are no suggestions.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Final

import click

from evaluator.cli.failures import Failure
from evaluator.cli.options import DEFAULT_URL
from evaluator.cli.paths import server_of_login
from evaluator.cli.tokens import token_for

if TYPE_CHECKING:
    from evaluator.client.client import Client

TIMEOUT_S: Final = 2.0


def splits(context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
    """The splits of the leaderboard that begin so."""
    return _asked(context, incomplete, own=False)


def methods(context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
    """The methods of one's own team that begin so."""
    return _asked(context, incomplete, own=True)


def _asked(context: click.Context, incomplete: str, *, own: bool) -> list[str]:
    from evaluator.client.answers import ClientError  # noqa: PLC0415 -- loads msgspec
    from evaluator.client.client import Client  # noqa: PLC0415 -- loads httpx, which --help can do without
    from evaluator.client.exchange import RetryPolicy  # noqa: PLC0415 -- the same

    url = context.params.get("url") or os.environ.get("TSTTC_URL") or server_of_login() or DEFAULT_URL
    once = RetryPolicy(n_tries=1, n_first_tries=1)
    try:
        token = token_for(url) if own else None
        with Client(url=url, token=token, timeout_s=TIMEOUT_S, patience=once) as client:
            names = _methods(client) if own else client.splits()
    except (ClientError, Failure):  # nobody who completes a word wants to read of it
        return []
    return [name for name in names if name.startswith(incomplete)]


def _methods(client: Client) -> list[str]:
    client.require_leaderboard()
    return [method.name for method in client.methods()]
