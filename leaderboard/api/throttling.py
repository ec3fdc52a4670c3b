"""Throttles: requests per account, else per address; see leaderboard/ops/rate_limits.py."""

from typing import TYPE_CHECKING

from django.core.cache import cache
from django.http import HttpRequest
from rest_framework.request import Request

from leaderboard.ops import rate_limits

if TYPE_CHECKING:  # views make their classes with these
    from rest_framework.views import APIView


def counted(request: HttpRequest) -> list["ApiThrottle"]:
    """Return the throttles that counted this request, a list to append to."""
    throttles: list[ApiThrottle] = request.__dict__.setdefault("_counted", [])
    return throttles


class ApiThrottle(rate_limits.Throttle):
    """A rate of `settings.API_RATES`, shown in the headers of the response."""

    def allow_request(self, request: Request, view: "APIView | None" = None) -> bool:
        is_allowed = super().allow_request(request, view)
        if self.key is not None:
            counted(request._request).append(self)
        return is_allowed


class SignedInThrottle(ApiThrottle):
    """Requests of one account, with any token."""

    scope = "signed_in"

    def identity(self, request: Request) -> object | None:
        return request.user.pk if request.user.is_authenticated else None


class VisitorThrottle(ApiThrottle):
    """Requests without an account from one address."""

    scope = "visitor"

    def identity(self, request: Request) -> object | None:
        return None if request.user.is_authenticated else super().identity(request)


class SubmitThrottle(SignedInThrottle):
    """Files of one account: also those that cost no quota are read and written."""

    scope = "submit"
    cache = cache

    def identity(self, request: Request) -> object | None:
        return super().identity(request) if request.method == "POST" else None


class AsOfThrottle(ApiThrottle):
    """Boards of the past, which take long to read, of one account or address."""

    scope = "as_of"

    def identity(self, request: Request) -> object | None:
        return rate_limits.account_or_address(request) if request.query_params.get("at") else None


class RevokeThrottle(ApiThrottle):
    """Reports of leaked tokens from one address, signed in or not."""

    scope = "revoke"
    cache = cache


class UnauthorizedThrottle(ApiThrottle):
    """Failed authentications from one address, checked first."""

    scope = "refused"
