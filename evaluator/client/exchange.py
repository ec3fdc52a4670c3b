"""One exchange with a server: what its answer means, and when it makes sense to try again."""

from __future__ import annotations

import random
import socket
import ssl
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TypeVar

import httpx2
import msgspec

from evaluator.client.answers import BadAnswer, NotSecure, Refused, Unreachable
from evaluator.problems import Problem

T = TypeVar("T")
PASSING_STATUSES = frozenset({429, 502, 503, 504})  # the same request may succeed a little later
QUOTA_EXCEEDED = "quota-exceeded"  # when to come back is for a person to decide, however soon it is


@dataclass(frozen=True, slots=True, kw_only=True)
class RetryPolicy:
    """The limits of retrying: a quarter of a minute, enough for a restart of the server."""

    n_tries: int = 9
    n_first_tries: int = 9  # where nothing has ever answered
    first_delay_s: float = 0.25
    longest_delay_s: float = 10.0
    longest_retry_after_s: float = 60.0  # who asks for more than this gets their answer reported instead
    factor: float = 1.5
    jitter: float = 0.2

    def delay_s(self, *, n_failed: int, retry_after_s: float | None, rng: random.Random) -> float:
        """Return the seconds to wait after `n_failed` tries (from 1), at least those of the server."""
        grown = min(self.longest_delay_s, self.first_delay_s * self.factor ** (n_failed - 1))
        return max(grown * (1 - self.jitter * rng.random()), retry_after_s or 0.0)

    def may_pass(self, fault: Refused) -> bool:
        """Return whether a retry may succeed within a bearable time."""
        if fault.code == QUOTA_EXCEEDED:
            return False
        if fault.status == httpx2.codes.TOO_MANY_REQUESTS and fault.retry_after_s is None:
            return False
        is_passing = fault.status in PASSING_STATUSES
        return is_passing and (fault.retry_after_s or 0.0) <= self.longest_retry_after_s


def checked(send: Callable[[], httpx2.Response], *, url: str) -> httpx2.Response:
    try:
        response = send()
    except (httpx2.InvalidURL, UnicodeError) as error:  # a host that no name system could know
        raise Unreachable(url=url, reason=str(error), was_connected=False, is_lasting=True) from error
    except (httpx2.ConnectError, httpx2.ConnectTimeout, httpx2.ProxyError) as error:
        raise _not_connected(error, url=url) from error
    except (httpx2.TransportError, httpx2.DecodingError) as error:
        raise Unreachable(url=url, reason=_reason(error), was_connected=True) from error
    if response.is_success:
        return response
    if response.is_redirect:
        raise BadAnswer(
            url=url, content=f"a redirect to {response.headers['location']}, which is not followed"
        )
    raise _refused(response)


def retry_after_s(headers: Mapping[str, str]) -> float | None:
    value = headers.get("retry-after", "").strip()
    return float(value) if value.isascii() and value.isdigit() else None


def _not_connected(error: httpx2.TransportError, *, url: str) -> Unreachable:
    reason = _reason(error)
    for cause in _causes(error):
        match cause:
            case ssl.SSLCertVerificationError():
                reason = cause.verify_message or reason
                return NotSecure(
                    url=url, reason=reason, was_connected=False, is_lasting=True, is_untrusted=True
                )
            case ssl.SSLError():
                reason = (cause.reason or reason).replace("_", " ").lower()
                return NotSecure(
                    url=url, reason=reason, was_connected=False, is_lasting=True, is_untrusted=False
                )
            case socket.gaierror():
                # Another try may help where the name server is away, not where it knows no such name.
                is_lasting = cause.errno != socket.EAI_AGAIN
                return Unreachable(url=url, reason=reason, was_connected=False, is_lasting=is_lasting)
    return Unreachable(url=url, reason=reason, was_connected=False)


def _causes(error: BaseException) -> Iterator[BaseException]:
    cause: BaseException | None = error
    while cause is not None:
        yield cause
        cause = cause.__cause__ or cause.__context__


def _reason(error: httpx2.TransportError | httpx2.DecodingError) -> str:
    if isinstance(error, httpx2.TimeoutException):
        return "it took too long"
    return str(error).strip() or type(error).__name__


def _refused(response: httpx2.Response) -> Refused:
    # Lenient, because a proxy may have written the answer.
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
        retry_after_s=retry_after_s(response.headers),
        document=document or None,
    )


def _text(value: object) -> str:
    return value if isinstance(value, str) else ""


def decoded(response: httpx2.Response) -> object:
    try:
        return msgspec.json.decode(response.content)
    except msgspec.DecodeError:
        content_type = response.headers.get("content-type", "no content type")
        raise BadAnswer(url=str(response.url), content=f"not JSON ({content_type})") from None


def one(response: httpx2.Response, kind: type[T], **more: object) -> T:
    """Decode an answer as `kind`, with the JSON as its `document`. Raises BadAnswer."""
    url, document = str(response.url), decoded(response)
    if not isinstance(document, dict):
        raise BadAnswer(url=url, content="JSON, but no object")
    return _converted(document, kind, url=url, **more)


def rows(response: httpx2.Response, kind: type[T]) -> list[T]:
    """Decode an answer as a list of `kind`. Raises BadAnswer."""
    url, document = str(response.url), decoded(response)
    if not isinstance(document, list):
        raise BadAnswer(url=url, content="JSON, but no list")
    return [_converted(row, kind, url=url) for row in document]


def next_page(response: httpx2.Response) -> Mapping[str, str]:
    """Return the query of the next page, empty on the last."""
    # The rest of `Link` is ignored, so that the token stays on this server.
    link = response.links.get("next", {}).get("url", "")
    try:
        return dict(httpx2.URL(link).params)
    except httpx2.InvalidURL:
        raise BadAnswer(url=str(response.url), content=f"a next page that is none ({link[:60]})") from None


def _converted(document: object, kind: type[T], *, url: str, **more: object) -> T:
    value = document
    if isinstance(document, dict) and hasattr(kind, "__struct_fields__"):
        value = {**document, "document": document, **more}
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        raise BadAnswer(url=url, content=str(error)) from None
