"""Limits of requests, judged before any of the body is read: size and rate.

The API has its own throttles (`leaderboard/api/throttling.py`), whose rates, counts and words these share.
"""

import math
import time
from collections.abc import Callable
from typing import Final

from django.conf import settings
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render

from leaderboard.errors import problem_codes
from leaderboard.ops import rate_limits
from leaderboard.submissions import submissions
from leaderboard.web.context_processors import page_before

# Room for the other fields and the boundaries of a multipart body.
FORM_BYTES = 100_000


class UploadLimitMiddleware:
    """Answers 413 to a request that announces more than a prediction file may have."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        """Let small requests pass."""
        announced = request.META.get("CONTENT_LENGTH") or "0"
        if announced.isdecimal() and int(announced) <= settings.MAX_PREDICTIONS_BYTES + FORM_BYTES:
            return self.get_response(request)
        sentence = submissions.too_large(found_bytes=int(announced) if announced.isdecimal() else 0)
        if request.path.startswith("/api/"):
            return problem_codes.response(status=413, code="too-large", detail=sentence, where="file")
        return render(request, "413.html", {"sentence": sentence}, status=413)


class RateLimitMiddleware:
    """Answers 429 to who does or draws too much on pages. What is answered from memory never comes here.

    What somebody sends is counted per account, else per address, for all web processes together; what is
    drawn is counted per address by this process alone, which costs the database nothing.
    """

    # The API counts by itself, and monitoring is not limited.
    ELSEWHERE: Final = ("/api/", "/healthz", "/readyz", "/healthy", "/metrics")
    drawn = rate_limits.InMemory()

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        """Let those pass who come now and then."""
        if not request.path.startswith(self.ELSEWHERE):
            answer = self._drawn(request) if request.method in {"GET", "HEAD"} else self._sent(request)
            if answer is not None and not answer.is_allowed:
                return _too_many(request, wait_s=answer.wait_s)
        return self.get_response(request)

    def _sent(self, request: HttpRequest) -> rate_limits.Decision | None:
        rate = settings.PAGE_RATES["send"]
        if rate is None:
            return None
        who = (
            f"account:{request.user.pk}" if request.user.is_authenticated else rate_limits.address_of(request)
        )
        return rate_limits.take(who=f"page_send:{who}", rate=rate_limits.rate_of(rate), now_s=time.time())

    def _drawn(self, request: HttpRequest) -> rate_limits.Decision | None:
        address, answer = rate_limits.address_of(request), None
        for name in ("as_of", "draw") if "at" in request.GET else ("draw",):
            rate = settings.PAGE_RATES[name]
            if rate is not None and (answer is None or answer.is_allowed):
                answer = self.drawn.take(
                    who=f"{name}:{address}", rate=rate_limits.rate_of(rate), now_s=time.monotonic()
                )
        return answer


def _too_many(request: HttpRequest, *, wait_s: float) -> HttpResponse:
    """The page that says so, when to come back, and where to go on."""
    context = {"sentence": rate_limits.refusal(wait_s), "back": page_before(request)}
    response = render(request, "429.html", context, status=429)
    response["Retry-After"] = str(max(1, math.ceil(wait_s)))
    return response
