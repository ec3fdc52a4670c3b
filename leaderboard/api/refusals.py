"""Requests that are turned away before any view: the usual throttles never see them; these have their own."""

from typing import Any

from rest_framework import exceptions
from rest_framework.response import Response

from leaderboard.api import problems
from leaderboard.api.throttles import MalformedThrottle, RefusedThrottle

# What authentication says after it has asked the database for a token.
LOOKED_UP = {
    "token-unknown",
    "token-expired",
    "token-revoked",
    "token-scope",
    "token-split",
    "account-closed",
}
TURNED_AWAY = (exceptions.NotAuthenticated, exceptions.AuthenticationFailed, exceptions.PermissionDenied)


def exception_handler(exc: Exception, context: dict[str, Any]) -> Response | None:
    """The problem that an exception is; one refusal too many from an address is a 429 instead."""
    if isinstance(exc, TURNED_AWAY):
        throttle = RefusedThrottle() if exc.get_codes() in LOOKED_UP else MalformedThrottle()
        if not throttle.allow_request(context["request"], context["view"]):
            exc = exceptions.Throttled(throttle.wait())
    return problems.exception_handler(exc, context)
