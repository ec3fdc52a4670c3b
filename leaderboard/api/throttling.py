"""How often one may ask: per account, else per address, which nobody can choose for themselves.

All web processes count together (see leaderboard/rates.py).
The address is the one that the connection comes from, or with `TSTTC_TRUSTED_PROXIES` the one that our own
proxy wrote down; what a visitor puts into X-Forwarded-For before that counts for nothing.
"""

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from django.conf import settings
from django.http import HttpRequest
from rest_framework.request import Request
from rest_framework.throttling import BaseThrottle

from leaderboard import rates

if TYPE_CHECKING:  # views make their classes with these
    from rest_framework.views import APIView


@dataclass(frozen=True)
class Counted:
    """That a request was counted: by which throttle, at which rate, and what it found."""

    name: str
    rate: rates.Rate
    answer: rates.Answer


def counted(request: HttpRequest) -> list[Counted]:
    """The throttles that counted this request, for its answer's headers; a list to add to."""
    found: list[Counted] = request.__dict__.setdefault("_counted", [])
    return found


class Throttle(BaseThrottle):
    """A rate of the settings, which may be none. After it was asked, `answer` says what it found."""

    scope = ""
    answer: rates.Answer | None = None

    def allow_request(self, request: Request, view: "APIView") -> bool:
        """Count this request. The rate is read anew, so that settings hold."""
        text: str | None = settings.API_RATES[self.scope]
        identity = self.identity(request) if text else None
        if text and identity is not None:
            rate = rates.rate_of(text)
            self.answer = self.take(f"{self.scope}:{identity}", rate)
            counted(request._request).append(Counted(self.scope, rate, self.answer))
        return self.answer is None or self.answer.is_allowed

    def take(self, who: str, rate: rates.Rate) -> rates.Answer:
        """Count it where all processes see it."""
        return rates.take(who=who, rate=rate, now_s=time.time())

    def wait(self) -> float | None:
        """Seconds until the next request is let through."""
        return self.answer.wait_s if self.answer else None

    def identity(self, request: Request) -> object | None:
        """Who is counted; None: not this throttle's concern."""
        raise NotImplementedError


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
        return None if request.user.is_authenticated else rates.address_of(request)


class SubmitThrottle(SignedInThrottle):
    """Files sent by one account: also those that cost no quota are read and written."""

    scope = "submit"

    def identity(self, request: Request) -> object | None:
        """The account, when it sends something."""
        return super().identity(request) if request.method == "POST" else None


class RevokeThrottle(Throttle):
    """Reports of leaked tokens from one address."""

    scope = "revoke"

    def identity(self, request: Request) -> object | None:
        """The address, also of who is signed in."""
        return rates.address_of(request)


# --- requests that are turned away before any view ----------------------------------------------------------


class RefusedThrottle(RevokeThrottle):
    """Requests from one address whose token opens nothing: they end before the throttles above are asked."""

    scope = "refused"


class MalformedThrottle(RefusedThrottle):
    """The same without the database, which what is no token at all never reaches."""

    memory = rates.InMemory()

    def take(self, who: str, rate: rates.Rate) -> rates.Answer:
        """Count it in this process."""
        return self.memory.take(who=who, rate=rate, now_s=time.time())
