"""The pages for a failure of the server and for a malformed request."""

import sys
from typing import Final

from django.conf import settings
from django.http import HttpRequest, HttpResponse, HttpResponseBadRequest, HttpResponseServerError
from django.middleware import csrf
from django.shortcuts import render
from django.template.loader import render_to_string

from leaderboard.errors import outages, problem_codes

SORRY = "This was an error on our side. We logged it; try again later."

_CAUSES: Final = {
    csrf.REASON_NO_CSRF_COOKIE: "cookie",
    csrf.REASON_NO_REFERER: "referer",
    csrf.REASON_MALFORMED_REFERER: "referer",
    csrf.REASON_INSECURE_REFERER: "referer",
}


def server_error(request: HttpRequest) -> HttpResponse:
    """Answer 503 or 507 where the cause is known, else 500, without the database."""
    outage = outages.answered(sys.exception(), marks=request.META)
    status, code, sentence, headers = (
        (outage.status, outage.code, outage.sentence, outage.headers)
        if outage is not None
        else (500, "server-error", SORRY, {})
    )
    if request.path.startswith("/api/"):
        return problem_codes.response(status=status, code=code, detail=sentence, headers=headers)
    if outage is None:
        return HttpResponseServerError(render_to_string("500.html", {"benchmark": settings.BENCHMARK}))
    page = render_to_string("outage.html", {"outage": outage, "benchmark": settings.BENCHMARK})
    return HttpResponse(page, status=outage.status, headers=outage.headers)


def form_refused(request: HttpRequest, reason: str = "") -> HttpResponse:
    """Refuse a form without a valid token: from another origin, without cookie or Referer, or an old one."""
    cause = _CAUSES.get(reason, "form")
    if cause == "form" and reason.startswith(("Origin checking", "Referer checking")):
        cause = "origin"
    origin = request.headers.get("Origin") or request.headers.get("Referer", "")
    context = {"cause": cause, "origin": origin[:200], "host": request.get_host()}
    return render(request, "403_csrf.html", context, status=403)


def bad_request(request: HttpRequest, exception: Exception) -> HttpResponse:
    if not request.path.startswith("/api/"):
        return HttpResponseBadRequest(render_to_string("400.html", {"benchmark": settings.BENCHMARK}))
    sentence = "The request is malformed or incomplete; expected a complete request, as the API describes it."
    return problem_codes.response(status=400, code="bad-request", detail=sentence)
