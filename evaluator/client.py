"""The leaderboard's API from a laptop or a CI job: the only module that speaks HTTP.

    with Client(url="https://example.org", token=token) as client:
        submission = client.submit(file, filename="predictions.json", split="val", method="Foo++")
        for submission in client.watch(submission.id, timeout_s=600):
            print(submission.state)

Every failure is an `answers.ClientError` that states facts (address, status, code, problems); the command
line words them. Sending is safe to repeat: bytes that the server holds get their first submission as answer.
"""

from __future__ import annotations

import email.utils
import random
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import BinaryIO, Self, TypeVar
from urllib.parse import quote, urlsplit

import httpx
import msgspec

from evaluator.answers import (
    BadAnswer,
    Board,
    Redirected,
    Refused,
    Submission,
    TimedOut,
    Unreachable,
)
from evaluator.problems import Problem

LOOPBACK_HOSTS = frozenset({"127.0.0.1", "::1", "localhost"})
PASSING_STATUSES = frozenset({429, 502, 503, 504})  # the same request may succeed a little later

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Patience:
    """How often and how long to try again: delays grow by `factor`, each shortened by up to `jitter`."""

    n_tries: int = 4
    first_delay_s: float = 0.25
    longest_delay_s: float = 10.0
    longest_retry_after_s: float = (
        30.0  # a server that asks for more than this gets its answer reported instead
    )
    factor: float = 1.6
    jitter: float = 0.2

    def delay_s(self, *, n_failed: int, retry_after_s: float | None, rng: random.Random) -> float:
        """Seconds to wait after `n_failed` tries (from 1); never less than the server asked for."""
        grown = min(self.longest_delay_s, self.first_delay_s * self.factor ** (n_failed - 1))
        return max(grown * (1 - self.jitter * rng.random()), retry_after_s or 0.0)


@dataclass(kw_only=True)
class Client:
    """A connection to one leaderboard. `url` is the site's address; `token` is sent as a bearer token.

    `timeout_s` bounds each wait for the network, not the whole; sleep, clock and generator can be replaced.
    """

    url: str
    token: str | None = field(default=None, repr=False)
    timeout_s: float = 30.0
    patience: Patience = Patience()
    user_agent: str = "tsttc"
    sleep: Callable[[float], None] = time.sleep
    monotonic_s: Callable[[], float] = time.monotonic
    rng: random.Random = field(default_factory=random.Random)

    def __post_init__(self) -> None:
        self.url = self.url.rstrip("/")
        headers = {"User-Agent": self.user_agent, "Accept": "application/json"}
        if self.token:
            headers["Authorization"] = f"Bearer {self.token}"
        self._http = httpx.Client(
            headers=headers,
            timeout=self.timeout_s,
            # A proxy from the environment never leads to this very machine.
            trust_env=urlsplit(self.url).hostname not in LOOPBACK_HOSTS,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self._http.close()

    def submit(
        self,
        file: BinaryIO,
        *,
        filename: str,
        split: str,
        method: str,
        details: Mapping[str, str] | None = None,
    ) -> Submission:
        """Send a prediction file for a split; gives the new submission, or the first one of the same bytes.

        `file` must be seekable; it is streamed, never read whole. `details` are the form's optional fields
        (description, paper_url, code_url, note, commit). Raises ClientError.
        """
        fields = {"split": split, "method": method, **(details or {})}

        def send() -> httpx.Response:
            file.seek(0)
            return self._http.post(
                self._address("submissions"),
                data=fields,
                files={"file": (filename, file, "application/json")},
            )

        response = self._insist(send)
        return self._read(response, Submission, is_new=response.status_code == httpx.codes.CREATED)

    def submission(self, submission_id: str) -> Submission:
        """The present state of a submission. Raises ClientError."""
        return self._get(Submission, "submissions", submission_id)

    def board(self, split: str, *, sort: str = "rank") -> Board:
        """The board of a split's published edition, in the order of column `sort`. Raises ClientError."""
        return self._get(Board, "splits", split, "board", params={"sort": sort})

    def manifest(self, split: str) -> bytes:
        """The split's manifest, CSV: the ground truth's columns but the values. Raises ClientError."""
        address = self._address("splits", split, "manifest")
        return self._insist(lambda: self._http.get(address, headers={"Accept": "text/csv, */*"})).content

    def watch(self, submission_id: str, *, timeout_s: float) -> Iterator[Submission]:
        """Ask until the submission is final, giving every state seen, the final one last.

        A server that is away or busy meanwhile is asked again, less and less often. Raises TimedOut after
        `timeout_s` seconds; of the other errors only those that waiting cannot cure.
        """
        until_s = self.monotonic_s() + timeout_s
        last: Submission | None = None
        state, n_same = "", 0
        while True:
            answer = self._look(submission_id)
            if answer.submission is not None:
                last = answer.submission
                yield last
                if last.is_final:
                    return
            seen = last.state if last else ""
            state, n_same = seen, (n_same + 1 if seen == state else 1)  # a change of state: ask often again
            delay_s = self.patience.delay_s(n_failed=n_same, retry_after_s=answer.retry_after_s, rng=self.rng)
            if self.monotonic_s() + delay_s > until_s:
                raise TimedOut(submission_id=submission_id, timeout_s=timeout_s, submission=last)
            self.sleep(delay_s)

    def _look(self, submission_id: str) -> _Glance:
        """One question about a submission; a fault that passes by itself is no answer, not an error."""
        address = self._address("submissions", submission_id)
        try:
            response = _checked(lambda: self._http.get(address), url=self.url)
        except Unreachable:
            return _Glance()
        except Refused as refused:
            if refused.status not in PASSING_STATUSES:
                raise
            return _Glance(retry_after_s=refused.retry_after_s)
        return _Glance(
            submission=self._read(response, Submission), retry_after_s=_retry_after_s(response.headers)
        )

    def _get(self, kind: type[T], *path: str, params: Mapping[str, str] | None = None) -> T:
        address = self._address(*path)
        return self._read(self._insist(lambda: self._http.get(address, params=params)), kind)

    def _address(self, *path: str) -> str:
        return "/".join([self.url, "api/v1", *(quote(part, safe="") for part in path)])

    def _insist(self, send: Callable[[], httpx.Response]) -> httpx.Response:
        """Send until answered, at most `patience.n_tries` times, as long as trying again makes sense."""
        n_failed = 0
        while True:
            try:
                return _checked(send, url=self.url)
            except (Unreachable, Refused) as fault:
                n_failed += 1
                if n_failed >= self.patience.n_tries or not self._may_pass(fault):
                    raise
                retry_after_s = fault.retry_after_s if isinstance(fault, Refused) else None
            self.sleep(self.patience.delay_s(n_failed=n_failed, retry_after_s=retry_after_s, rng=self.rng))

    def _may_pass(self, fault: Unreachable | Refused) -> bool:
        if isinstance(fault, Unreachable):
            return (
                fault.was_connected
            )  # an address where nothing listens is a mistake more often than a pause
        if fault.status == httpx.codes.TOO_MANY_REQUESTS and fault.retry_after_s is None:
            return False
        return (
            fault.status in PASSING_STATUSES
            and (fault.retry_after_s or 0.0) <= self.patience.longest_retry_after_s
        )

    def _read(self, response: httpx.Response, kind: type[T], **more: object) -> T:
        """The JSON answer as `kind`, with the whole of it as its `document`."""
        url = str(response.url)
        try:
            document = msgspec.json.decode(response.content)
        except msgspec.DecodeError:
            found = response.headers.get("content-type", "no content type")
            raise BadAnswer(url=url, found=f"not JSON ({found})") from None
        if not isinstance(document, dict):
            raise BadAnswer(url=url, found="JSON, but no object")
        try:
            return msgspec.convert({**document, "document": document, **more}, kind)
        except msgspec.ValidationError as error:
            raise BadAnswer(url=url, found=str(error)) from None


@dataclass(frozen=True, slots=True)
class _Glance:
    submission: Submission | None = None
    retry_after_s: float | None = None


def _checked(send: Callable[[], httpx.Response], *, url: str) -> httpx.Response:
    """The response, if it is one of success; raises Unreachable, Redirected or Refused."""
    try:
        response = send()
    except (httpx.InvalidURL, UnicodeError) as error:  # a host that no name system could know
        raise Unreachable(url=url, reason=str(error), was_connected=False) from error
    except (httpx.ConnectError, httpx.ConnectTimeout, httpx.ProxyError) as error:
        raise Unreachable(url=url, reason=_reason(error), was_connected=False) from error
    except (httpx.TransportError, httpx.DecodingError) as error:
        raise Unreachable(url=url, reason=_reason(error), was_connected=True) from error
    if response.is_success:
        return response
    if response.is_redirect:
        raise Redirected(url=url, location=response.headers["location"])
    raise _refused(response)


def _reason(error: httpx.TransportError | httpx.DecodingError) -> str:
    if isinstance(error, httpx.TimeoutException):
        return "it took too long"
    return str(error).strip() or type(error).__name__


def _refused(response: httpx.Response) -> Refused:
    """An error answer read leniently: whatever stands between client and server may have written it."""
    try:
        document = msgspec.json.decode(response.content)
    except msgspec.DecodeError:
        document = None
    if not isinstance(document, dict):
        document = {}
    try:
        problems = msgspec.convert(document.get("problems", ()), tuple[Problem, ...])
    except msgspec.ValidationError:
        problems = ()
    return Refused(
        url=str(response.url),
        status=response.status_code,
        title=_text(document.get("title")) or response.reason_phrase,
        detail=_text(document.get("detail")),
        code=_text(document.get("code")),
        problems=problems,
        retry_after_s=_retry_after_s(response.headers),
        document=document or None,
    )


def _text(value: object) -> str:
    return value if isinstance(value, str) else ""


def _retry_after_s(headers: Mapping[str, str]) -> float | None:
    """Seconds from a Retry-After header (a number, or an HTTP date), None where it is absent or senseless."""
    value = headers.get("retry-after", "").strip()
    if value.isascii() and value.isdigit():
        return float(value)
    try:
        until = email.utils.parsedate_to_datetime(value)
    except ValueError:
        return None
    if until.tzinfo is None:
        return None
    # The one place that reads the calendar: the header names a time of day instead of a duration.
    seconds = (until - datetime.now(UTC)).total_seconds()
    return max(0.0, seconds)
