"""Arguments and options that several subcommands share."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeVar
from urllib.parse import urlsplit

import click

from evaluator.cli.paths import server_of_login
from evaluator.units import KINDS, MIN_DAYS

DEFAULT_URL = "http://127.0.0.1:8000"
NETWORK_TIMEOUT_S: Final = 15.0
"""How long a request and its repetitions may take."""
_TIMEOUT: Final = "tsttc.timeout_s"
_SECONDS: Final = click.FloatRange(min=0, min_open=True)
TOKEN_VARIABLE = "TSTTC_TOKEN"  # noqa: S105 -- the name of a variable, not a token

Command = TypeVar("Command", bound=Callable[..., Any])

default_option: Final = partial(click.option, show_default=True)
"""An option whose help shows its default."""


def json_option(command: Command) -> Command:
    return click.option("--json", "as_json", is_flag=True, help="Print one JSON document.")(command)


def predictions_argument(command: Command) -> Command:
    kind = click.Path(exists=True, dir_okay=False, allow_dash=True, path_type=Path)
    return click.argument("predictions", type=kind)(command)


def output_option(what: str) -> Callable[[Command], Command]:
    return click.option(
        "-o",
        "--output",
        type=click.Path(dir_okay=False, path_type=Path),
        metavar="FILE",
        help=f"Write {what} to this file (default: standard output).",
    )


def site_options(command: Command) -> Command:
    """--server, and --timeout for the requests of a command that waits for nothing else."""

    def keep(context: click.Context, _parameter: click.Parameter, value: float) -> None:
        context.meta[_TIMEOUT] = value

    option = default_option(
        "--timeout",
        type=_SECONDS,
        metavar="SECONDS",
        default=NETWORK_TIMEOUT_S,
        expose_value=False,
        callback=keep,
        help="Stop asking the server after this time.",
    )
    return url_option(option(command))


def network_timeout_s() -> float:
    """The --timeout of the present command, by `site_options`."""
    context = click.get_current_context(silent=True)
    timeout_s: float = context.meta.get(_TIMEOUT, NETWORK_TIMEOUT_S) if context else NETWORK_TIMEOUT_S
    return timeout_s


def url_option(command: Command) -> Command:
    return click.option(
        "--server",
        "--url",
        "url",
        metavar="URL",
        envvar="TSTTC_URL",
        default=lambda: server_of_login() or DEFAULT_URL,
        show_default=f"that of tsttc login, else {DEFAULT_URL}",
        show_envvar=True,
        callback=_site,
        help="Address of the leaderboard.",
    )(command)


def unit_option(command: Command) -> Command:
    return click.option(
        "--unit",
        type=click.Choice(list(KINDS)),
        help="What intervals take as independent, as the board's edition says; default: the column unit of "
        f"the ground truth, else days if all recordings have dates and there are {MIN_DAYS} days, else "
        "recordings.",
    )(command)


def timeout_option(help_text: str, *, default: float) -> Callable[[Command], Command]:
    """--timeout: how long to wait for a result."""
    return default_option(
        "--timeout", "timeout_s", type=_SECONDS, metavar="SECONDS", default=default, help=help_text
    )


def slug(_context: click.Context, _parameter: click.Parameter, value: str | None) -> str | None:
    """Check a name for use in an address: letters, digits, hyphens and underscores."""
    if value is not None and not re.fullmatch(r"[A-Za-z0-9_-]{1,100}", value):
        raise click.BadParameter(f"found {value!r}, expected letters, digits, hyphens and underscores alone.")
    return value


def sendable(_context: click.Context, _parameter: click.Parameter, value: str | None) -> str | None:
    if value is not None and not is_utf8(value):
        raise click.BadParameter(f"found {value!r}, expected UTF-8 text.")
    return value


def is_utf8(text: str) -> bool:
    # Arguments and file names have lone surrogates for other bytes.
    return not any("\ud800" <= character <= "\udfff" for character in text)


def _site(_context: click.Context, _parameter: click.Parameter, value: str) -> str:
    try:
        parts = urlsplit(value)
        is_web = parts.scheme in {"http", "https"} and bool(parts.hostname) and parts.port != 0
    except ValueError:  # brackets or a port that are none
        is_web = False
    if not is_web:
        raise click.BadParameter(f"found {value!r}, expected an address like https://example.org.")
    if parts.username or parts.password or parts.query or parts.fragment:
        raise click.BadParameter(
            f"expected only the address of the site; a token belongs in the variable {TOKEN_VARIABLE}."
        )
    return value


def site_of(url: str) -> str:
    """Return the address of the site itself: a leaderboard is at the root of its host.

    >>> site_of("https://leaderboard.example.org/api/v1/"), site_of("http://127.0.0.1:8000")
    ('https://leaderboard.example.org', 'http://127.0.0.1:8000')
    """
    path = urlsplit(url).path.strip("/")
    return url.rstrip("/").removesuffix(path).rstrip("/")


def tokens_page(url: str) -> str:
    """Return the page on which a person creates and revokes tokens."""
    return f"{site_of(url)}/tokens/"
