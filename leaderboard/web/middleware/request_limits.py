"""What a request may ask for, judged before any of its body is read: how large it is, and how often it comes.

The API has its own throttles (`leaderboard/api/throttles.py`), whose rates, counts and words these share.
"""

import math
import time
from collections.abc import Callable
from typing import Final
from urllib.parse import urlsplit

from django.conf import settings
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import render
from django.utils.http import url_has_allowed_host_and_scheme

from leaderboard import problem_codes, rates, submissions

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
        if not request.path.startswith("/api/"):
            response = render(request, "413.html", {"sentence": sentence}, status=413)
        else:
            response = JsonResponse(
                problem_codes.document(status=413, code="too-large", detail=sentence, where="file"),
                status=413,
                content_type=problem_codes.MEDIA_TYPE,
            )
        return response


class RateLimitMiddleware:
    """Answers 429 to who does or draws too much on pages. What is answered from memory never comes here.

    What somebody sends is counted per account, else per address, for all web processes together; what is
    drawn is counted per address by this process alone, which costs the database nothing.
    """

    # The API counts by itself, and monitoring is not limited.
    ELSEWHERE: Final = ("/api/", "/healthz", "/readyz", "/metrics")
    drawn = rates.InMemory()

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        """Let those pass who come now and then."""
        if not request.path.startswith(self.ELSEWHERE):
            answer = self._drawn(request) if request.method in {"GET", "HEAD"} else self._sent(request)
            if answer is not None and not answer.is_allowed:
                return _too_many(request, wait_s=answer.wait_s)
        return self.get_response(request)

    def _sent(self, request: HttpRequest) -> rates.Answer | None:
        rate = settings.PAGE_RATES["send"]
        if rate is None:
            return None
        who = f"account:{request.user.pk}" if request.user.is_authenticated else rates.address_of(request)
        return rates.take(who=f"page_send:{who}", rate=rates.rate_of(rate), now_s=time.time())

    def _drawn(self, request: HttpRequest) -> rates.Answer | None:
        rate = settings.PAGE_RATES["draw"]
        if rate is None:
            return None
        return self.drawn.take(
            who=rates.address_of(request), rate=rates.rate_of(rate), now_s=time.monotonic()
        )


def _too_many(request: HttpRequest, *, wait_s: float) -> HttpResponse:
    """The page that says so, when to come back, and where to go on."""
    context = {"sentence": rates.refusal(wait_s), "back": _page_before(request)}
    response = render(request, "429.html", context, status=429)
    response["Retry-After"] = str(max(1, math.ceil(wait_s)))
    return response


def _page_before(request: HttpRequest) -> str:
    """The page of ours that somebody came from; empty if it is none of ours."""
    referrer = request.META.get("HTTP_REFERER", "")
    is_ours = url_has_allowed_host_and_scheme(
        referrer, allowed_hosts={request.get_host()}, require_https=request.is_secure()
    )
    return urlsplit(referrer)._replace(scheme="", netloc="", fragment="").geturl() if is_ours else ""
