"""The command line's connection to a leaderboard, and what each of its faults is called in plain words."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import click

from evaluator.cli.failures import FILE_AT_FAULT, SERVER, USAGE, Failure
from evaluator.cli.options import TOKEN_VARIABLE

if TYPE_CHECKING:
    from evaluator.answers import ClientError, Refused
    from evaluator.client import Client

# A problem that names one of these is about the command's options; any other is about the file.
OPTIONS = frozenset({"split", "method", "description", "paper_url", "code_url", "note", "commit", "sort"})


def token() -> str:
    """The token from the environment, never from the command line, where every process could read it."""
    value = os.environ.get(TOKEN_VARIABLE, "").strip()
    if not value:
        raise Failure(
            f"{TOKEN_VARIABLE} is not set, and this needs a token.",
            exit_code=USAGE,
            code="no-token",
            hint=f"Make a token on your account page, then: export {TOKEN_VARIABLE}=…",
        )
    if not value.isascii() or not value.isprintable() or " " in value:
        raise Failure(
            f"{TOKEN_VARIABLE} is no token: it contains characters that no token has.",
            exit_code=USAGE,
            code="no-token",
        )
    return value


@contextmanager
def connect(url: str, *, with_token: bool) -> Iterator[Client]:
    """A client for the site at `url`; its errors leave as failures worded for a person."""
    bearer = token() if with_token else None
    from evaluator.answers import ClientError  # noqa: PLC0415 -- loads msgspec
    from evaluator.client import LOOPBACK_HOSTS, Client  # noqa: PLC0415 -- loads httpx, which --help can do without

    site = urlsplit(url)
    if bearer and site.scheme == "http" and site.hostname not in LOOPBACK_HOSTS:
        click.echo(f"Warning: the token goes to {url} unencrypted; use https where you can.", err=True)
    try:
        with Client(url=url, token=bearer, user_agent=f"tsttc/{version()}") as client:
            yield client
    except ClientError as error:
        raise in_words(error) from error


def version() -> str:
    """The installed version; 0 in a checkout that was never installed."""
    import importlib.metadata  # noqa: PLC0415 -- costs more time than the rest of --help

    try:
        return importlib.metadata.version("tsttc")
    except importlib.metadata.PackageNotFoundError:
        return "0"


def in_words(error: ClientError) -> Failure:
    """What happened, whose fault it is and what to do next."""
    from evaluator.answers import BadAnswer, Redirected, Refused, TimedOut, Unreachable  # noqa: PLC0415 -- msgspec

    hint = "Check --url (or TSTTC_URL), your network, and whether the server is up."
    more: dict[str, Any] = {}
    match error:
        case Refused():
            return _refused(error)
        case Unreachable(was_connected=False):
            code, words = "unreachable", f"Nothing answers at {error.url} ({error.reason})."
        case Unreachable():
            code, words = "cut-off", f"{error.url} gave no whole answer ({error.reason})."
            hint = "Run the command again: a file that did arrive is not counted twice."
        case Redirected():
            code, words = "redirected", f"{error.url} points to {error.location}, which was not followed."
        case BadAnswer():
            code, words = "bad-answer", f"{error.url} gave no leaderboard's answer: {error.found}."
        case TimedOut():
            last = f" It was {error.submission.state} last." if error.submission else ""
            code, words = "timeout", f"{_sentence(str(error))}{last}"
            more = {"submission": error.submission.document if error.submission else None}
            hint = f"It goes on by itself; follow it with: tsttc status {error.submission_id} --watch"
        case _:
            code, words = "client", _sentence(str(error))
    return Failure(words, exit_code=SERVER, code=code, hint=hint, more=more)


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."


def _refused(error: Refused) -> Failure:
    said = (error.detail or error.title).rstrip(".")
    words, hint = _words_for(error.status, said=said, retry_after_s=error.retry_after_s)
    return Failure(
        words,
        exit_code=_exit_code(error),
        code=error.code or f"http-{error.status}",
        problems=[p for p in error.problems if p.message != error.detail],  # the words above say it already
        hint=hint,
        document=error.document,
    )


def _exit_code(error: Refused) -> int:
    """Whose fault a refusal is: the file's, the command's, or a matter between user and server."""
    if error.status in {413, 415}:
        return FILE_AT_FAULT
    if error.status in {400, 422}:
        about_options = error.problems and all(p.where in OPTIONS for p in error.problems)
        return USAGE if about_options else FILE_AT_FAULT
    return SERVER


def _words_for(status: int, *, said: str, retry_after_s: float | None) -> tuple[str, str]:
    again = f"Try again in {_duration(retry_after_s)}." if retry_after_s else "Try again later."
    known = {
        400: (f"The server does not understand the request: {said}.", ""),
        401: (
            f"The server does not accept the token: {said}.",
            f"Make a new one and set {TOKEN_VARIABLE} to it.",
        ),
        403: (f"This token may not do that: {said}.", ""),
        404: (f"The server knows no such thing: {said}.", "Check the name, or the id, and --url."),
        409: (f"The server cannot take it now: {said}.", ""),
        413: (f"The file is too large: {said}.", ""),
        415: (f"The file is of the wrong kind: {said}.", ""),
        422: (f"The server does not accept the submission: {said}.", ""),
        429: (f"Too much at once: {said}.", again),
    }
    if status in known:
        return known[status]
    if status >= 500:
        return f"The server failed ({status}: {said}). The fault is not yours.", again
    return f"The server refused ({status}: {said}).", ""


def _duration(seconds: float) -> str:
    """
    >>> _duration(45), _duration(600), _duration(7200)
    ('45 s', '10 min', '2 h')
    """
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.0f} h"
