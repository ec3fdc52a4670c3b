"""Headers of every answer of the API: what is left of the limits, and whether it is known already.

`RateLimit-Policy` and `RateLimit` are those of draft-ietf-httpapi-ratelimit-headers, with a limit for each
of the throttles that counted the request.
"""

import hashlib
import math
from collections.abc import Callable

from django.http import HttpRequest, HttpResponse, HttpResponseNotModified

from leaderboard.api.throttles import Counted, counted
from leaderboard.keeping import is_known

Next = Callable[[HttpRequest], HttpResponse]


class ApiHeadersMiddleware:
    """Sets them on what views below /api/ answer."""

    def __init__(self, get_response: Next) -> None:
        self._get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        """Answer, with the headers."""
        response = self._get_response(request)
        if not request.path.startswith("/api/"):
            return response
        response = _conditional(request, response)
        limits = counted(request)
        if limits:
            response["RateLimit-Policy"] = ", ".join(_policy(limit) for limit in limits)
            response["RateLimit"] = ", ".join(_left(limit) for limit in limits)
        return response


def _policy(limit: Counted) -> str:
    return f'"{limit.name}";q={limit.rate.n};w={limit.rate.period_s:g}'


def _left(limit: Counted) -> str:
    # With nothing left: until the next request is let through. Otherwise nobody has to wait.
    return f'"{limit.name}";r={limit.answer.n_left};t={math.ceil(limit.answer.wait_s)}'


def _conditional(request: HttpRequest, response: HttpResponse) -> HttpResponse:
    """The answer with its ETag, or 304 for a program that has it already.

    What is kept for everybody has one of its own, and a file, which is not made for nothing, says it itself.
    """
    if request.method not in {"GET", "HEAD"} or response.status_code != 200:
        return response
    if response.streaming:
        return response
    if not response.has_header("ETag"):
        response["ETag"] = f'"{hashlib.sha256(response.content).hexdigest()[:32]}"'
    if not is_known(request, response["ETag"]):
        return response
    known = HttpResponseNotModified()
    for name in ("ETag", "Vary", "Cache-Control"):
        if response.has_header(name):
            known[name] = response[name]
    return known
