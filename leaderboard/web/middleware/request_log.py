"""Logging of requests: one line each, with an id that the response carries as well."""

import re

import structlog
from django.http import HttpRequest, HttpResponse
from django.utils.functional import SimpleLazyObject
from django_structlog.middlewares import RequestMiddleware

# Asked every few seconds by machines; worth a line only when they fail.
QUIET = frozenset({"/healthz", "/readyz", "/metrics"})

# What comes behind this is the secret of an invitation.
SECRET_PATH = re.compile(r"^(/team/join/).+", re.DOTALL)


class RequestLogMiddleware(RequestMiddleware):
    """Binds `request_id` to every line, says nothing of what people type, and never asks the database."""

    def handle_response(self, request: HttpRequest, response: HttpResponse) -> None:
        """Write the line, and tell the id to whoever asked."""
        response["X-Request-ID"] = structlog.contextvars.get_contextvars().get("request_id", "")
        if request.path in QUIET and response.status_code < 500:
            structlog.contextvars.clear_contextvars()
            return
        super().handle_response(request, response)

    @staticmethod
    def format_request(request: HttpRequest) -> str:
        """Method and path; what stays out is the query, which somebody typed, and what lets its reader in."""
        path = SECRET_PATH.sub(r"\1…", request.path)
        return f"{request.method} {path}"

    @staticmethod
    def bind_user_id(request: HttpRequest) -> None:
        """The account's number, if it is known already: a log line is no reason to look it up."""
        user = getattr(request, "_cached_user", None) or request.__dict__.get("user")
        # By type: asking a lazy object for its class would make it ask the database.
        if user is not None and type(user) is not SimpleLazyObject and user.pk is not None:
            structlog.contextvars.bind_contextvars(user_id=user.pk)
