"""A connection to one leaderboard: requests with and without the token, sent again where that makes sense."""

from __future__ import annotations

import random
import ssl
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Self, TypeVar
from urllib.parse import quote, urlsplit

import httpx

from evaluator.client.answers import Refused, Unreachable
from evaluator.client.exchange import RetryPolicy, checked, next_page, one, rows

LOOPBACK_HOSTS = frozenset({"127.0.0.1", "::1", "localhost"})

T = TypeVar("T")


def _certificates(url: str) -> ssl.SSLContext | bool:
    """What a connection trusts: nothing where there is no TLS, since reading all certificates takes 40 ms."""
    return ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT) if urlsplit(url).scheme == "http" else True


@dataclass(kw_only=True)
class Connection:
    """A connection to one leaderboard. `url` is the site's address; `token` is sent as a bearer token.

    `timeout_s` bounds each wait for the network, not the whole; sleep, clock and generator can be replaced.
    """

    url: str
    token: str | None = field(default=None, repr=False)
    timeout_s: float = 30.0
    patience: RetryPolicy = field(default_factory=RetryPolicy)
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
            verify=_certificates(self.url),
            # A proxy from the environment never leads to this very machine.
            trust_env=urlsplit(self.url).hostname not in LOOPBACK_HOSTS,
        )
        self._was_answered = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self._http.close()

    def _listed(self, kind: type[T], *path: str) -> Iterator[T]:
        """The rows of a list, page after page."""
        params: Mapping[str, str] = {}
        while True:
            response = self._retry(partial(self._http.get, self._address(*path), params=params))
            yield from rows(response, kind)
            params = next_page(response)
            if not params:
                return

    def _get(self, kind: type[T], *path: str, params: Mapping[str, str] | None = None) -> T:
        return one(self._asked(*path, params=params), kind)

    def _asked(self, *path: str, params: Mapping[str, str] | None = None) -> httpx.Response:
        return self._retry(lambda: self._http.get(self._address(*path), params=params))

    def _asked_by_anybody(self, *path: str, accept: str, **query: int) -> httpx.Response:
        """What everybody may read is read without the token, which may not be good for reading."""
        headers = {"Accept": accept}
        request = self._http.build_request("GET", self._address(*path), params=query, headers=headers)
        request.headers.pop("Authorization", None)
        return self._retry(lambda: self._http.send(request))

    def _address(self, *path: str) -> str:
        return "/".join([self.url, "api/v1", *(quote(part, safe="") for part in path)])

    def _checked(self, send: Callable[[], httpx.Response]) -> httpx.Response:
        """As `checked`; remembers that the server is one that answers."""
        try:
            response = checked(send, url=self.url)
        except Unreachable as fault:
            self._was_answered = self._was_answered or fault.was_connected
            raise
        except Refused:
            self._was_answered = True
            raise
        self._was_answered = True
        return response

    def _retry(self, send: Callable[[], httpx.Response]) -> httpx.Response:
        """Send until answered, as often as the patience goes, as long as trying again makes sense."""
        n_failed = 0
        while True:
            try:
                return self._checked(send)
            except (Unreachable, Refused) as fault:
                n_failed += 1
                n_tries = self.patience.n_tries if self._was_answered else self.patience.n_first_tries
                is_lasting = isinstance(fault, Refused) and not self.patience.may_pass(fault)
                if n_failed >= n_tries or is_lasting:
                    raise
                delay_after_s = fault.retry_after_s if isinstance(fault, Refused) else None
            self.sleep(self.patience.delay_s(n_failed=n_failed, retry_after_s=delay_after_s, rng=self.rng))
