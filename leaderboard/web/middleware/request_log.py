"""Logging of requests: one line each, with an id that the response carries as well."""

import re
import sys
import time
from typing import Any

import structlog
from django.db import Error as DatabaseProblem
from django.http import HttpRequest, HttpResponse
from django.utils import timezone
from django.utils.functional import SimpleLazyObject
from django_structlog.middlewares import RequestMiddleware

from leaderboard.errors import outages
from leaderboard.ops import faults, prometheus
from leaderboard.web.middleware import monitoring_host

# Asked every few seconds by machines; worth a line only when they fail.
QUIET = monitoring_host.ADDRESSES

# What comes behind this is the secret of an invitation, or of a mail to the owner of an account.
SECRET_PATH = re.compile(r"^(/team/join/|/accounts/undo/|/accounts/password/reset/key/).+", re.DOTALL)


# Where files are sent to.
UPLOADS = frozenset({"/submit/", "/api/v1/submissions"})

log = structlog.get_logger(__name__)


class RequestLogMiddleware(RequestMiddleware):
    def prepare(self, request: HttpRequest) -> None:
        request.META["tsttc.begun_s"] = time.perf_counter()
        super().prepare(request)

    def handle_response(self, request: HttpRequest, response: HttpResponse) -> None:
        _count(request, response)
        _note_refusal(request, response)
        response["X-Request-ID"] = structlog.contextvars.get_contextvars().get("request_id", "")
        if request.path in QUIET and response.status_code < 500:
            structlog.contextvars.clear_contextvars()
            return
        super().handle_response(request, response)

    def process_got_request_exception(self, sender: Any, request: HttpRequest, **kwargs: Any) -> None:
        # An outage has a line of its own, and a traceback through our code says nothing more.
        if outages.outage_of(sys.exception()) is None:
            super().process_got_request_exception(sender, request, **kwargs)

    @staticmethod
    def format_request(request: HttpRequest) -> str:
        """Return method and path, without query and secrets."""
        path = SECRET_PATH.sub(r"\1…", request.path)
        return f"{request.method} {path}"

    @staticmethod
    def bind_user_id(request: HttpRequest) -> None:
        # A log line is no reason to load the user.
        user = getattr(request, "_cached_user", None) or request.__dict__.get("user")
        # By type: asking a lazy object for its class would make it ask the database.
        if user is not None and type(user) is not SimpleLazyObject and user.pk is not None:
            structlog.contextvars.bind_contextvars(user_id=user.pk)


def _count(request: HttpRequest, response: HttpResponse) -> None:
    # Cached answers have no route.
    if request.path in QUIET:
        return
    match = request.resolver_match
    route = (match.view_name or "unnamed") if match else ("memory" if response.status_code < 400 else "none")
    took_s = time.perf_counter() - request.META.get("tsttc.begun_s", time.perf_counter())
    prometheus.count(method=request.method or "", route=route, status=response.status_code, took_s=took_s)


def _note_refusal(request: HttpRequest, response: HttpResponse) -> None:
    """Note an upload that got no answer but an error of ours, for health, metrics and maintainers."""
    if response.status_code < 500 or request.method != "POST" or request.path_info not in UPLOADS:
        return
    code = request.META.get(outages.MARK, "server-error")
    # Asking a database that is away would only delay the answer; its own check tells of it.
    if code == outages.DATABASE_AWAY.code:
        return
    try:
        faults.note(faults.UPLOADS, reason=f"{response.status_code} {code}", now=timezone.now())
    except DatabaseProblem as fault:
        log.warning("refusal_not_noted", reason=str(fault)[:200])
