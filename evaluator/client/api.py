"""A client of the leaderboard's API, for a laptop or a CI job.

    with Client(url="https://example.org", token=token) as client:
        submission = client.submit("predictions.json", split="val", method="Foo++")
        for submission in client.watch(submission.id, timeout_s=600):
            print(submission.state)

Every failure is an `answers.ClientError`. Submitting the same bytes again returns their first submission.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Self, TypeVar
from urllib.parse import quote

import httpx2

from evaluator.arguments import Source, data_of
from evaluator.client.answers import (
    JSON,
    Account,
    BadAnswer,
    Board,
    ClientError,
    Compared,
    Method,
    Quota,
    Refused,
    Submission,
    TimedOut,
    Unreachable,
    VisibilityPreview,
)
from evaluator.client.exchange import (
    PASSING_STATUSES,
    RetryPolicy,
    checked,
    next_page,
    one,
    retry_after_s,
    rows,
)
from evaluator.client.surroundings import certificates_for, proxy_for, without_password

T = TypeVar("T")

INTERVALS_WITHIN_S = 10.0
N_EARLY_LOOKS, EARLY_LOOK_S = 4, 0.2


@dataclass(kw_only=True)
class Client:
    """A connection to one leaderboard. `timeout_s` bounds a request together with its repetitions.

    Waiting times that the server asks for in `Retry-After` are not counted.
    """

    url: str
    token: str | None = field(default=None, repr=False)
    timeout_s: float = 15.0
    retry_policy: RetryPolicy = field(default_factory=RetryPolicy)
    user_agent: str = "tsttc"
    sleep: Callable[[float], None] = time.sleep
    monotonic_s: Callable[[], float] = time.monotonic
    rng: random.Random = field(default_factory=random.Random)
    on_wait: Callable[[ClientError, float], None] | None = None
    """Called with the fault and the seconds to wait, before a request is repeated."""

    def __post_init__(self) -> None:
        self.url = self.url.rstrip("/")
        headers = {"User-Agent": self.user_agent, "Accept": "application/json"}
        if self.token:
            headers["Authorization"] = f"Bearer {self.token}"
        self._proxy = proxy_for(self.url)
        self._http = httpx2.Client(
            headers=headers,
            timeout=self.timeout_s,
            verify=certificates_for(self.url),
            proxy=self._proxy,
            trust_env=False,  # `surroundings` has read it
        )
        self._was_answered = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self._http.close()

    def require_leaderboard(self) -> None:
        """Raise ClientError if the address is not a leaderboard; the token is not sent."""
        self.splits()

    def splits(self) -> list[str]:
        """List the names of the splits; the token is not sent."""
        try:
            response = self._asked_by_anybody("splits", accept="application/json")
        except Refused as refused:
            if refused.status in PASSING_STATUSES or refused.code:
                raise  # a leaderboard that is away, or refuses in its own words
            raise BadAnswer(url=self.url, content=f"{refused.status} {refused.title}".strip()) from None
        names = [row.get("split") for row in rows(response, JSON)]
        if not all(isinstance(name, str) for name in names):
            raise BadAnswer(url=self.url, content="a list of other things than splits")
        return [str(name) for name in names]

    def account(self) -> Account:
        """Fetch the account of the token."""
        return self._get(Account, "account")

    def submit(
        self,
        source: Source,
        *,
        split: str,
        method: str,
        filename: str = "predictions.json",
        details: Mapping[str, str] | None = None,
    ) -> Submission:
        """Submit a prediction file; returns the new submission, or the first one of the same bytes."""
        data = data_of(source)
        fields = {"split": split, "method": method, **(details or {})}
        n_sent = 0

        def send() -> httpx2.Response:
            nonlocal n_sent
            n_sent += 1
            return self._http.post(
                self._address("submissions"),
                data=fields,
                files={"file": (filename, data, "application/json")},
            )

        response = self._retry(send)
        # An earlier try of this very call may have made it, of which only the answer was lost.
        is_new = n_sent > 1 or response.status_code == httpx2.codes.CREATED
        return one(response, Submission, is_new=is_new)

    def submission(self, submission_id: str) -> Submission:
        """Fetch the state of a submission."""
        return self._get(Submission, "submissions", submission_id)

    def board(
        self,
        split: str,
        *,
        sort: str = "rank",
        edition: int | None = None,
        at: str | None = None,
        has_intervals: bool = False,
    ) -> Board:
        """Fetch the board of a split: current, of an `edition`, or as of `at` (a date or an ISO time)."""
        edition_path = [] if edition is None else ["editions", str(edition)]
        asked = {"sort": sort, "at": at, "intervals": "1" if has_intervals else None}
        params = {name: value for name, value in asked.items() if value}
        return self._get(Board, "splits", split, *edition_path, "board", params=params)

    def export(
        self,
        board: Board,
        suffix: str,
        *,
        sort: str = "rank",
        at: str | None = None,
        has_intervals: bool = False,
    ) -> str:
        """Download the public export of this board, as "csv" or "bib"."""
        is_of_edition = board.edition is not None and not at
        path = f"{quote(board.split, safe='')}{f'/editions/{board.edition}' if is_of_edition else ''}"
        asked = {"sort": sort, "at": at, "intervals": "1" if has_intervals else None}
        params = {name: value for name, value in asked.items() if value and value != "rank"}
        return self._retry(lambda: self._http.get(f"{self.url}/board/{path}.{suffix}", params=params)).text

    def manifest(self, split: str, *, edition: int | None = None) -> bytes:
        """Download the manifest of a split or edition: all columns except the true times."""
        query = {} if edition is None else {"edition": edition}
        return self._asked_by_anybody("splits", split, "manifest", accept="text/csv, */*", **query).content

    def editions(self, split: str) -> list[tuple[int, str]]:
        """List the published editions of a split: their numbers, and the digests of their manifests."""
        response = self._asked_by_anybody("splits", split, "editions", accept="application/json")
        listed = [(row.get("edition"), row.get("manifest")) for row in rows(response, JSON)]
        return [(number, str(digest)) for number, digest in listed if isinstance(number, int)]

    def quota(self) -> list[Quota]:
        """Fetch your team's remaining submissions, by split."""
        return rows(self._asked("quota"), Quota)

    def compare(self, split: str, methods: Sequence[str], *, timeout_s: float = 120.0) -> Compared:
        """Compare methods of a split's board by id; asks until workers have computed the comparison."""
        until_s = self.monotonic_s() + timeout_s
        params = {"split": split, "m": list(methods)}
        address, n_asked = self._address("compare"), 0
        while True:
            response = self._retry(lambda: self._http.get(address, params=params))
            comparison = one(response, Compared)
            if comparison.is_complete:
                return comparison
            n_asked += 1
            asked_s = retry_after_s(response.headers)
            delay_s = self.retry_policy.delay_s(n_failed=n_asked, retry_after_s=asked_s, rng=self.rng)
            if self.monotonic_s() + delay_s >= until_s:
                raise TimedOut(what="the comparison is not ready", timeout_s=timeout_s)
            self.sleep(delay_s)

    def own_method(self, name_or_id: str) -> Method | None:
        """Fetch your team's method with this name or id."""
        return next((row for row in self.methods() if name_or_id in {row.id, row.name}), None)

    def methods(self) -> Iterator[Method]:
        """Fetch your team's methods by name."""
        return self._listed(Method, "methods")

    def submissions(self) -> Iterator[Submission]:
        """List your team's submissions, newest first."""
        return self._listed(Submission, "submissions")

    def file(self, submission_id: str) -> bytes:
        """Download the file of a submission of your team as it was sent."""
        return self._asked("submissions", submission_id, "file").content

    def withdraw(self, submission_id: str) -> Submission:
        """Withdraw or cancel a submission of your team. This cannot be undone."""
        address = self._address("submissions", submission_id, "withdraw")
        return one(self._retry(lambda: self._http.post(address)), Submission)

    def move(self, submission_id: str, *, method: str) -> Submission:
        """Move a submission to another private method of your team, by name or id."""
        address = self._address("submissions", submission_id, "move")
        return one(self._retry(lambda: self._http.post(address, json={"method": method})), Submission)

    def method(self, method_id: str) -> Method:
        """Fetch a method as this account may see it."""
        return self._get(Method, "methods", method_id)

    def visibility_preview(self, method_id: str, visibility: str) -> VisibilityPreview:
        """Preview what everyone would see of your own method if it were "PUBLIC" or "ANONYMOUS"."""
        return self._get(VisibilityPreview, "methods", method_id, "visibility", params={"as": visibility})

    def show_method(self, method_id: str, visibility: str, *, reveal_at: str | None = None) -> Method:
        """Publish a method as "PUBLIC" or, until `reveal_at`, "ANONYMOUS", for good."""
        address = self._address("methods", method_id, "visibility")
        body = {"visibility": visibility, "confirm": True, "reveal_at": reveal_at}
        return one(self._retry(lambda: self._http.post(address, json=body)), Method)

    def receipt(self, submission_id: str) -> bytes:
        """Download the signed receipt of a scored submission, a JSON Web Token."""
        return self._asked("submissions", submission_id, "receipt").content

    def receipt_keys(self) -> bytes:
        """Download the site's present and former receipt keys, a JSON Web Key Set."""
        address = f"{self.url}/.well-known/tsttc-receipt-keys.json"
        return self._retry(lambda: self._http.get(address)).content

    def watch(self, submission_id: str, *, timeout_s: float) -> Iterator[Submission]:
        """Yield each state of a submission until it is final and has its intervals.

        Waits at most `INTERVALS_WITHIN_S` for intervals. Raises TimedOut after `timeout_s` seconds, and at
        once the errors that a retry cannot cure.
        """
        until_s = self.monotonic_s() + timeout_s
        last: Submission | None = None
        n_same = n_looks = 0
        address = self._address("submissions", submission_id)
        while True:
            before, again_s = last, None
            try:
                response = self._checked(lambda: self._http.get(address))
            except Unreachable:
                pass
            except Refused as refused:
                if refused.status not in PASSING_STATUSES:
                    raise
                again_s = refused.retry_after_s
            else:
                last, again_s = one(response, Submission), retry_after_s(response.headers)
                yield last
                n_looks += 1
                if last.is_final and not last.awaits_intervals:
                    return
                if last.is_final and not (before and before.is_final):
                    until_s = min(until_s, self.monotonic_s() + INTERVALS_WITHIN_S)
            is_same = (before and before.state) == (last and last.state)
            n_same = n_same + 1 if is_same else 1  # a change: ask often again
            delay_s = self._next_look_s(again_s, n_same=n_same, n_looks=n_looks)
            if self.monotonic_s() + delay_s >= until_s:
                if last is not None and last.is_final:
                    return
                what = f"submission {submission_id} is not final"
                raise TimedOut(what=what, timeout_s=timeout_s, submission_id=submission_id, submission=last)
            self.sleep(delay_s)

    def _next_look_s(self, again_s: float | None, *, n_same: int, n_looks: int) -> float:
        if again_s == 1 and n_looks <= N_EARLY_LOOKS:  # Retry-After has no way to say less
            return EARLY_LOOK_S
        return again_s or self.retry_policy.delay_s(n_failed=n_same, retry_after_s=None, rng=self.rng)

    def _listed(self, kind: type[T], *path: str) -> Iterator[T]:
        params: Mapping[str, str] = {}
        while True:
            response = self._retry(partial(self._http.get, self._address(*path), params=params))
            yield from rows(response, kind)
            params = next_page(response)
            if not params:
                return

    def _get(self, kind: type[T], *path: str, params: Mapping[str, str] | None = None) -> T:
        return one(self._asked(*path, params=params), kind)

    def _asked(self, *path: str, params: Mapping[str, str] | None = None) -> httpx2.Response:
        return self._retry(lambda: self._http.get(self._address(*path), params=params))

    def _asked_by_anybody(self, *path: str, accept: str, **query: int) -> httpx2.Response:
        # Without the token, which may lack the right to read.
        headers = {"Accept": accept}
        request = self._http.build_request("GET", self._address(*path), params=query, headers=headers)
        request.headers.pop("Authorization", None)
        return self._retry(lambda: self._http.send(request))

    def _address(self, *path: str) -> str:
        return "/".join([self.url, "api/v1", *(quote(part, safe="") for part in path)])

    def _checked(
        self, send: Callable[[], httpx2.Response], *, timeout_s: float | None = None
    ) -> httpx2.Response:
        self._http.timeout = timeout_s or self.timeout_s
        try:
            response = checked(send, url=self.url)
        except Unreachable as fault:
            self._was_answered = self._was_answered or fault.was_connected
            if not fault.was_connected and self._proxy is not None:
                proxy = without_password(str(self._proxy.url))
                fault.reason = f"through the proxy {proxy}, which the environment names: {fault.reason}"
            raise
        except Refused:
            self._was_answered = True
            raise
        self._was_answered = True
        return response

    def _retry(self, send: Callable[[], httpx2.Response]) -> httpx2.Response:
        n_failed, until_s = 0, self.monotonic_s() + self.timeout_s
        while True:
            try:
                return self._checked(send, timeout_s=until_s - self.monotonic_s())
            except (Unreachable, Refused) as fault:
                n_failed += 1
                n_tries = self.retry_policy.n_tries if self._was_answered else self.retry_policy.n_first_tries
                is_lasting = (
                    not self.retry_policy.may_pass(fault)
                    if isinstance(fault, Refused)
                    else fault.is_lasting and not self._was_answered
                )
                after_s = fault.retry_after_s if isinstance(fault, Refused) else None
                delay_s = self.retry_policy.delay_s(n_failed=n_failed, retry_after_s=after_s, rng=self.rng)
                until_s += after_s or 0.0
                is_late = self.monotonic_s() + delay_s >= until_s
                if n_failed >= n_tries or is_lasting or is_late:
                    raise
                if self.on_wait is not None:
                    self.on_wait(fault, delay_s)
            self.sleep(delay_s)
