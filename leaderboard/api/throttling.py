"""Throttles: requests per account, else per address, counted for all web processes together.

The address is that of the connection, or with `TSTTC_TRUSTED_PROXIES` the one that our own proxy wrote down;
whatever a client puts into X-Forwarded-For is ignored. See leaderboard/ops/rate_limits.py.
"""

import time
from typing import TYPE_CHECKING

from django.conf import settings
from django.http import HttpRequest
from rest_framework.request import Request
from rest_framework.throttling import BaseThrottle

from leaderboard.ops import rate_limits

if TYPE_CHECKING:  # views make their classes with these
    from rest_framework.views import APIView


def counted(request: HttpRequest) -> list["Throttle"]:
    """The throttles that counted this request, for the headers of its response; a list to append to."""
    found: list[Throttle] = request.__dict__.setdefault("_counted", [])
    return found


class Throttle(BaseThrottle):
    """A rate of `settings.API_RATES`, which may be None; `rate` and `answer` are set once it has counted."""

    scope = ""
    rate: rate_limits.Rate
    answer: rate_limits.Decision | None = None

    def allow_request(self, request: Request, view: "APIView") -> bool:
        """Count this request."""
        text: str | None = settings.API_RATES[self.scope]
        identity = self.identity(request) if text else None
        if not text or identity is None:
            return True
        self.rate = rate_limits.rate_of(text)
        self.answer = self.take(f"{self.scope}:{identity}")
        counted(request._request).append(self)
        return self.answer.is_allowed

    def take(self, who: str) -> rate_limits.Decision:
        """Count the request in the database, where all processes see it."""
        return rate_limits.take(who=who, rate=self.rate, now_s=time.time())

    def wait(self) -> float | None:
        """Seconds until the next request is allowed."""
        return self.answer.wait_s if self.answer else None

    def identity(self, request: Request) -> object | None:
        """Who is counted: the address. None: this throttle does not apply."""
        return rate_limits.address_of(request)


class SignedInThrottle(Throttle):
    """Requests of one account, whatever token it uses."""

    scope = "signed_in"

    def identity(self, request: Request) -> object | None:
        """The account."""
        return request.user.pk if request.user.is_authenticated else None


class VisitorThrottle(Throttle):
    """Requests without an account from one address."""

    scope = "visitor"

    def identity(self, request: Request) -> object | None:
        """The address."""
        return None if request.user.is_authenticated else super().identity(request)


class SubmitThrottle(SignedInThrottle):
    """Files sent by one account: also those that cost no quota are read and written."""

    scope = "submit"

    def identity(self, request: Request) -> object | None:
        """The account, if it sends something."""
        return super().identity(request) if request.method == "POST" else None


class AsOfThrottle(Throttle):
    """Boards as of a time, which take long to read, of one account or one address."""

    scope = "as_of"

    def identity(self, request: Request) -> object | None:
        """The account, else the address, if it asks for a time."""
        if not request.query_params.get("at"):
            return None
        return request.user.pk if request.user.is_authenticated else super().identity(request)


class RevokeThrottle(Throttle):
    """Reports of leaked tokens from one address, signed in or not."""

    scope = "revoke"


class UnauthorizedThrottle(Throttle):
    """Requests from one address that fail authentication, before the throttles above are asked."""

    scope = "refused"


class MalformedTokenThrottle(UnauthorizedThrottle):
    """The same in memory: a malformed token never reaches the database."""

    memory = rate_limits.InMemory()

    def take(self, who: str) -> rate_limits.Decision:
        """Count the request in this process."""
        return self.memory.take(who=who, rate=self.rate, now_s=time.time())
