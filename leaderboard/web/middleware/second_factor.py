"""Where `TSTTC_REQUIRE_SECOND_FACTOR` is on, only a second factor makes a session that of a maintainer."""

from collections.abc import Callable
from typing import Any

from allauth.account.authentication import get_authentication_records
from django.conf import settings
from django.contrib import messages
from django.contrib.auth.models import AnonymousUser
from django.http import HttpRequest, HttpResponse, HttpResponseBase
from django.shortcuts import redirect, resolve_url
from django.utils.functional import SimpleLazyObject
from django.utils.http import urlencode
from django_htmx.http import HttpResponseClientRefresh

from leaderboard.models import User
from leaderboard.people import second_factor


class SecondFactorMiddleware:
    """Leads from `/maintain/` and `/admin/` to the page that sets up the second factor, or asks for it.

    On all other pages and in the API, a session without a code sees and does no more than other people.
    """

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self._get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        """Look at the session as soon as somebody asks for its user."""
        if settings.REQUIRE_SECOND_FACTOR:
            user = request.user
            request.user = SimpleLazyObject(lambda: _marked(request, user))  # type: ignore[assignment]  # it is lazy, as Django's own
        return self._get_response(request)

    def process_view(
        self, request: HttpRequest, view: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]
    ) -> HttpResponseBase | None:
        """Redirect, or let the view answer."""
        if not _is_for_maintainers(request) or not request.user.is_authenticated:
            return None
        step = _missing_step(request, request.user)
        if not step:
            return None
        if getattr(request, "htmx", None):
            return HttpResponseClientRefresh()  # a part of an open page: the whole page leads on
        if request.method not in {"GET", "HEAD"}:
            return redirect(step)
        if step == "mfa_activate_totp":
            messages.warning(request, "Maintainers of this site need a second factor. Set it up first.")
            return redirect(step)
        return redirect(f"{resolve_url(step)}?{urlencode({'next': request.get_full_path()})}")


def _is_for_maintainers(request: HttpRequest) -> bool:
    match = request.resolver_match
    if match is None:
        return False
    name = match.url_name or ""
    return name != "logout" if match.namespace == "admin" else name.startswith("maintain")


def _marked(request: HttpRequest, user: User | AnonymousUser) -> User | AnonymousUser:
    if user.is_authenticated:
        user.owes_a_code = bool(_missing_step(request, user))
    return user


def _missing_step(request: HttpRequest, user: User) -> str:
    """The name of the page that a maintainer has to pass first; empty where nothing is missing.

    It is the session that has to be opened with a code: one that was opened by a password alone, before the
    app was set up, is no better for it.
    """
    if not settings.REQUIRE_SECOND_FACTOR or not user.is_maintainer:
        return ""
    if not second_factor.is_set_up(user):
        return "mfa_activate_totp"
    has_given_a_code = any(each.get("method") == "mfa" for each in get_authentication_records(request, user))
    return "" if has_given_a_code else "mfa_reauthenticate"
