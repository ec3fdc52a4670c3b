"""Headers of every response of the API: ETag, and rate limits by draft-ietf-httpapi-ratelimit-headers."""

import hashlib
import math
from collections.abc import Callable

from django.conf import settings
from django.http import HttpRequest, HttpResponse, HttpResponseNotModified

from leaderboard.api.throttling import counted
from leaderboard.errors import problem_codes
from leaderboard.http_caching import is_known

# Not a redirect, as for pages: curl takes that for success, or follows it without the file.
HTTPS_REQUIRED = (
    "The address begins with http://; expected https://. Nothing was done. If the request had a token, "
    "others on the network could read it: revoke it."
)

Next = Callable[[HttpRequest], HttpResponse]


class ApiHeadersMiddleware:
    def __init__(self, get_response: Next) -> None:
        self._get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        if not request.path.startswith("/api/"):
            return self._get_response(request)
        if settings.SECURE_SSL_REDIRECT and not request.is_secure():
            return problem_codes.response(status=403, code="https-required", detail=HTTPS_REQUIRED)
        response = self._get_response(request)
        response = _conditional(request, response)
        throttles = counted(request)
        if throttles:
            response["RateLimit-Policy"] = ", ".join(
                f'"{each.scope}";q={each.num_requests};w={each.duration}' for each in throttles
            )
            response["RateLimit"] = ", ".join(
                f'"{each.scope}";r={each.n_left};t={math.ceil(each.wait_s)}' for each in throttles
            )
        return response


def _conditional(request: HttpRequest, response: HttpResponse) -> HttpResponse:
    """Add an ETag, or answer 304; files have an ETag of their own."""
    if request.method not in {"GET", "HEAD"} or response.status_code != 200 or response.streaming:
        return response
    if not response.has_header("ETag"):
        response["ETag"] = f'"{hashlib.sha256(response.content).hexdigest()[:32]}"'
    if not is_known(request, response["ETag"]):
        return response
    known = HttpResponseNotModified()
    for name in ("ETag", "Vary", "Cache-Control", "Retry-After"):
        if response.has_header(name):
            known[name] = response[name]
    return known
