"""The command line's connection to a leaderboard, and what each of its faults is called in plain words."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import click

import evaluator
from evaluator.cli.exits import Exit
from evaluator.cli.failures import Failure
from evaluator.cli.layout import printable
from evaluator.cli.options import NETWORK_TIMEOUT_S, TOKEN_VARIABLE, network_timeout_s, site_of, tokens_page
from evaluator.cli.tokens import token_for

if TYPE_CHECKING:
    from evaluator.client.answers import ClientError, NotSecure, Refused
    from evaluator.client.api import Client

# A problem that names one of these is about the command's options; any other is about the file.
OPTIONS = frozenset(
    {
        *("split", "method", "description", "paper_url", "code_url", "note", "commit"),
        *("sort", "at", "m", "visibility"),
    }
)
TOKENS_INSTEAD = {
    "token-scope": "Create a token with this scope",
    "token-split": "Create a token for that split, or for all splits,",
}
UNKNOWN_SPLIT = "unknown-split"  # the server's code
# Who waits longer than this wants to know for what.
WORTH_A_LINE_S = 5.0


@contextmanager
def connect(
    url: str, *, with_token: bool, token: str | None = None, timeout_s: float | None = None
) -> Iterator[Client]:
    """Open a client for the site at `url`, with `token` or the stored one; raises Failure.

    A request and its repetitions end after --timeout. Of a command that waits for a result, `timeout_s` is
    that option, and its requests end after `NETWORK_TIMEOUT_S` where that is less.
    """
    # The site must answer as a leaderboard before the token or a file is sent.
    bearer = token or (token_for(url) if with_token else None)
    from evaluator.client.answers import ClientError, Refused  # noqa: PLC0415 -- loads msgspec
    from evaluator.client.api import Client  # noqa: PLC0415 -- loads httpx2, which --help can do without
    from evaluator.client.exchange import RetryPolicy  # noqa: PLC0415 -- the same
    from evaluator.client.surroundings import LOOPBACK_HOSTS  # noqa: PLC0415 -- the same

    site = urlsplit(url)
    if bearer and site.scheme == "http" and site.hostname not in LOOPBACK_HOSTS:
        click.echo(f"Warning: the token goes to {url} unencrypted; use https where you can.", err=True)
    # A job may begin before its server has; a person who mistyped an address wants to hear of it at once.
    retry_policy = RetryPolicy(n_first_tries=1) if sys.stderr.isatty() else RetryPolicy()
    agent = f"tsttc/{evaluator.__version__}"
    try:
        with Client(
            url=url,
            token=bearer,
            timeout_s=min(timeout_s, NETWORK_TIMEOUT_S) if timeout_s else network_timeout_s(),
            user_agent=agent,
            retry_policy=retry_policy,
            on_wait=_say_wait,
        ) as client:
            if bearer:
                client.require_leaderboard()
            try:
                yield client
            except Refused as error:
                splits = _splits_instead(client, error)
                if not splits:
                    raise
                raise unknown_split(splits, document=error.document) from error
    except ClientError as error:
        raise in_words(error, url=url) from error


def _say_wait(fault: ClientError, delay_s: float) -> None:
    if delay_s >= WORTH_A_LINE_S:
        message = printable(in_words(fault, url="").message)
        click.echo(f"{message}\nTrying again in {duration(delay_s)}.", err=True)


def _splits_instead(client: Client, error: Refused) -> list[str]:
    # Raises BadAnswer where the refusal is that of another web server.
    from evaluator.client.answers import BadAnswer, ClientError  # noqa: PLC0415 -- loads msgspec

    context = click.get_current_context(silent=True)
    split = context.params.get("split") if context else None
    if error.status != 404 or (error.code and not split):
        return []
    try:
        known = client.splits()
    except BadAnswer:
        raise
    except ClientError:
        return []
    return [] if not split or split in known else [printable(name) for name in known]


def unknown_split(splits: Sequence[str], *, document: dict[str, Any] | None = None) -> Failure:
    """The command names a split that is not one of these, in the words of the server about a file for it."""
    context = click.get_current_context(silent=True)
    split = context.params.get("split") if context else None
    return Failure(
        f"There is no split {split!r}; expected one of {', '.join(splits)}.",
        exit_code=Exit.USAGE,
        code=UNKNOWN_SPLIT,
        document=document,
    )


def in_words(error: ClientError, *, url: str, hint: str = "") -> Failure:
    """Describe an error of the client and the next step; `hint` is the next step of a refusal."""
    from evaluator.client.answers import BadAnswer, BadSurroundings, NotSecure, Refused, TimedOut, Unreachable  # noqa: PLC0415 -- loads msgspec

    refused_hint = hint
    hint = "Check --server (or TSTTC_URL), your network, and whether the server runs."
    exit_code = Exit.NETWORK
    more: dict[str, Any] = {}
    match error:
        case Refused():
            return _refused(error, url=url, hint=refused_hint)
        case NotSecure():
            return _not_secure(error)
        case BadSurroundings():
            code, words, hint = "bad-surroundings", _sentence(error.reason), error.hint
        case Unreachable(was_connected=False):
            code, words = "unreachable", f"Nothing answers at {error.url} ({error.reason})."
        case Unreachable():
            code, words = "cut-off", f"{error.url} gave an incomplete answer ({error.reason})."
            context = click.get_current_context(silent=True)
            is_sending = context is not None and context.info_name == "submit"
            hint = f"Run the command again{': the same file never counts twice' if is_sending else ''}."
        case BadAnswer():
            code, words = "bad-answer", f"{error.url} did not answer like a leaderboard: {error.content}."
            site = urlsplit(url)
            if site.path.strip("/"):
                hint = f"{hint} The address is that of the site, such as {site.scheme}://{site.netloc}."
        case TimedOut():
            last = f" It was {error.submission.state} last." if error.submission else ""
            exit_code, code, words = Exit.TIMEOUT, "timeout", f"{_sentence(str(error))}{last}"
            hint = "The workers are busy; ask again later."
            if error.submission_id:
                more = {"submission": error.submission.document if error.submission else None}
                hint = f"The evaluation continues; follow it with: tsttc status {error.submission_id} --watch"
        case _:
            code, words = "client", _sentence(str(error))
    return Failure(words, exit_code=exit_code, code=code, hint=hint, more=more)


def _not_secure(error: NotSecure) -> Failure:
    words = f"{error.url} answers, but not over TLS ({error.reason})."
    hint = "Check --server (or TSTTC_URL): a server without TLS has an address with http://."
    if error.is_untrusted:
        words = f"This machine does not trust the certificate of {error.url} ({error.reason})."
        hint = (
            "Check --server (or TSTTC_URL). If the certificate is of an authority of your own, name the file "
            "of that authority: export SSL_CERT_FILE=/path/to/ca.pem"
        )
    return Failure(words, exit_code=Exit.NETWORK, code="not-secure", hint=hint)


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:].removesuffix('.')}."


def _refused(error: Refused, *, url: str, hint: str) -> Failure:
    words = _sentence(error.detail) if error.detail else _words_for(error)
    return Failure(
        words,
        exit_code=exit_code_of(error),
        code=error.code or f"http-{error.status}",
        problems=[p for p in error.problems if p.message != error.detail],  # the words above say it already
        hint=hint or _hint_for(error, url=url),
        document=error.document,
    )


def exit_code_of(error: Refused) -> Exit:
    if error.status in {400, 422}:
        about_options = error.problems and all(p.where in OPTIONS for p in error.problems)
        return Exit.USAGE if about_options else Exit.REJECTED
    known = {
        401: Exit.AUTH,
        403: Exit.AUTH,
        413: Exit.REJECTED,
        415: Exit.REJECTED,
        429: Exit.QUOTA,
    }
    if error.status in known:
        return known[error.status]
    return Exit.SYSTEM if error.status >= 500 else Exit.REFUSED


def _words_for(error: Refused) -> str:
    # A proxy answers with no problem document.
    if error.status >= 500:
        return f"The server failed ({error.status}: {error.title})."
    if error.status in {401, 403}:
        return f"The server does not accept the token ({error.status}: {error.title})."
    if error.status == 413:
        return (
            f"The server takes no file of this size ({error.status}: {error.title}); its page “Submit” says "
            "how large a file may be. gzip makes a prediction file much smaller: send FILE.json.gz."
        )
    return f"The server refused ({error.status}: {error.title})."


def _hint_for(error: Refused, *, url: str) -> str:
    again = f"Try again in {duration(error.retry_after_s)}." if error.retry_after_s else ""
    if error.status == 401:
        return f"Create a token at {tokens_page(url)}, then: tsttc login, or set {TOKEN_VARIABLE}."
    if error.status == 403 and error.code in TOKENS_INSTEAD:
        return f"{TOKENS_INSTEAD[error.code]} at {tokens_page(url)}"
    if error.status == 404 and error.code != "no-ground-truth":
        site = site_of(url)
        elsewhere = f" The address is that of the site, such as {site}." if site != url.rstrip("/") else ""
        return f"Check the name, or the id, and --server.{elsewhere}"
    if error.status == 429:
        return again or "Show your quota with: tsttc quota"
    if error.status >= 500:
        return f"This is not your fault. {again or 'Try again later.'}"
    return again


def duration(seconds: float) -> str:
    """
    >>> duration(45), duration(600), duration(7200)
    ('45 s', '10 min', '2 h')
    """
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.0f} h"
