"""Limits of size and rate, checked before the body is read. The API has its own throttles."""

import math
from collections.abc import Callable
from typing import Final

from django.conf import settings
from django.core.cache import cache
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.urls import reverse

from leaderboard.errors import problem_codes
from leaderboard.ops import rate_limits
from leaderboard.submissions import intake
from leaderboard.web.lookups import page_before
from leaderboard.web.middleware import monitoring_host

# Room for the other fields and the boundaries of a multipart body.
FORM_BYTES = 100_000


class UploadLimitMiddleware:
    """Answers 413 to a request that announces more than a prediction file may have."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        announced = request.META.get("CONTENT_LENGTH") or "0"
        if announced.isdecimal() and int(announced) <= settings.MAX_PREDICTIONS_BYTES + FORM_BYTES:
            return self.get_response(request)
        sentence = intake.too_large(n_bytes=int(announced) if announced.isdecimal() else 0)
        if request.path.startswith("/api/"):
            return problem_codes.response(status=413, code="too-large", detail=sentence, where="file")
        return render(request, "413.html", {"sentence": sentence}, status=413)


class FormThrottle(rate_limits.Throttle):
    """Writing requests of one account, else of one address."""

    rates, scope, cache = "PAGE_RATES", "send", cache

    def identity(self, request: HttpRequest) -> object | None:
        return rate_limits.account_or_address(request)


class PageThrottle(rate_limits.Throttle):
    """Pages rendered for one address."""

    rates, scope = "PAGE_RATES", "draw"


class AsOfPageThrottle(rate_limits.Throttle):
    """Pages of boards of the past, for one address."""

    rates, scope = "PAGE_RATES", "as_of"

    def identity(self, request: HttpRequest) -> object | None:
        return super().identity(request) if "at" in request.GET else None


class SearchThrottle(rate_limits.Throttle):
    """Searches in the guides, for one address: each reads all of them."""

    rates, scope = "PAGE_RATES", "search"

    def identity(self, request: HttpRequest) -> object | None:
        is_search = request.path == reverse("docs_search") and request.GET.get("q")
        return super().identity(request) if is_search else None


class RateLimitMiddleware:
    """Answers 429 to too many requests; cached answers are not counted."""

    # The API counts by itself, and monitoring is not limited.
    ELSEWHERE: Final = ("/api/", *monitoring_host.ADDRESSES)

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        if not request.path.startswith(self.ELSEWHERE):
            is_reading = request.method in {"GET", "HEAD"}
            reading = (AsOfPageThrottle(), SearchThrottle(), PageThrottle())
            for throttle in reading if is_reading else (FormThrottle(),):
                if not throttle.allow_request(request):
                    return _too_many(request, wait_s=throttle.wait_s)
        return self.get_response(request)


def _too_many(request: HttpRequest, *, wait_s: float) -> HttpResponse:
    context = {"sentence": rate_limits.refusal(wait_s), "back": page_before(request)}
    response = render(request, "429.html", context, status=429)
    response["Retry-After"] = str(max(1, math.ceil(wait_s)))
    return response
