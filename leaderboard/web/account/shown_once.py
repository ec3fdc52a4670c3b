"""A secret that is shown once, on the page after its form.

Until then it is in a cookie for this page alone: HttpOnly, signed for this account, for two minutes. It is in
no table, address or log.
"""

from typing import Any, Final, cast

from django.conf import settings
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.urls import reverse
from django.views.decorators.debug import sensitive_variables

from leaderboard.models import User

COOKIE: Final = "shown-once"
LIFETIME_S: Final = 120


@sensitive_variables("secret")
def redirect_with(secret: str, *, request: HttpRequest, to: str) -> HttpResponse:
    """Redirect to the page of the route `to`, which `render_with` draws."""
    response = redirect(to)
    response.set_signed_cookie(
        COOKIE,
        secret,
        salt=_salt(request, to),
        max_age=LIFETIME_S,
        path=reverse(to),
        secure=settings.SESSION_COOKIE_SECURE,
        httponly=True,
        samesite="Strict",
    )
    return response


@sensitive_variables("secret")
def render_with(
    request: HttpRequest, template: str, context: dict[str, Any], *, at: str, status: int = 200
) -> HttpResponse:
    """Render the page of the route `at` with the new `secret`, if there is one."""
    secret = request.get_signed_cookie(COOKIE, default="", salt=_salt(request, at), max_age=LIFETIME_S)
    response = render(request, template, {**context, "secret": secret}, status=status)
    if COOKIE in request.COOKIES:
        response.delete_cookie(COOKIE, path=reverse(at), samesite="Strict")
    return response


def _salt(request: HttpRequest, route: str) -> str:
    return f"{COOKIE}:{route}:{cast('User', request.user).pk}"
