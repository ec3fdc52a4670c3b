"""The page for an error of ours, which says what it knows of it."""

import sys

from django.http import HttpRequest, HttpResponse, HttpResponseServerError, JsonResponse
from django.template.loader import render_to_string

from leaderboard import outages


def server_error(request: HttpRequest) -> HttpResponse:
    """Django's handler of what no view has handled: 503 or 507 where the cause is known, else 500.

    Rendered without the request: the usual frame asks the database who is reading.
    """
    outage = outages.outage_of(sys.exception())
    if outage is None:
        return HttpResponseServerError(render_to_string("500.html"))
    if request.path.startswith("/api/"):
        problem = {"code": outage.code, "message": outage.sentence, "where": ""}
        return JsonResponse(
            {
                "type": "about:blank",
                "title": outage.title,
                "status": outage.status,
                "code": outage.code,
                "detail": outage.sentence,
                "problems": [problem],
            },
            status=outage.status,
            headers=outage.headers,
            content_type="application/problem+json",
        )
    page = render_to_string("outage.html", {"outage": outage})
    return HttpResponse(page, status=outage.status, headers=outage.headers)
