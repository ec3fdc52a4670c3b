"""With `TSTTC_REQUIRE_SECOND_FACTOR` on, a session is a maintainer's only after a second factor."""

from collections.abc import Callable
from typing import Any, Final

from allauth.account.authentication import get_authentication_records
from django.conf import settings
from django.contrib import messages
from django.contrib.auth import logout
from django.contrib.auth.models import AnonymousUser
from django.http import HttpRequest, HttpResponse, HttpResponseBase
from django.shortcuts import redirect, resolve_url
from django.utils.functional import SimpleLazyObject
from django.utils.http import urlencode
from django_htmx.http import HttpResponseClientRefresh

from leaderboard.models import User
from leaderboard.people import second_factor

_SIGN_IN: Final = "account_login"
_SET_UP: Final = "mfa_activate_totp"
_SIGN_IN_AGAIN: Final = (
    "Maintainers of this site need two-factor authentication. To set it up, sign in again: this time the "
    "site also asks for a code that we mail to you."
)


class SecondFactorMiddleware:
    """Redirects maintainers to the missing step; on other pages their session is an ordinary user's."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self._get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        if settings.REQUIRE_SECOND_FACTOR:
            user = request.user
            request.user = SimpleLazyObject(lambda: _marked(request, user))  # type: ignore[assignment]  # it is lazy, as Django's own
        return self._get_response(request)

    def process_view(
        self, request: HttpRequest, view: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]
    ) -> HttpResponseBase | None:
        # The user is asked for last: a probe with a session cookie must not need the database.
        if not _is_guarded(request) or not request.user.is_authenticated:
            return None
        step = _missing_step(request, request.user)
        if not step:
            return None
        if getattr(request, "htmx", None):
            return HttpResponseClientRefresh()  # a part of an open page: the whole page leads on
        return _lead(request, step)


def _lead(request: HttpRequest, step: str) -> HttpResponseBase | None:
    """Redirect to the missing step; None on its own page."""
    if step == _name(request):
        return None
    back = {"next": request.get_full_path()}
    if step == _SIGN_IN:
        logout(request)
        messages.warning(request, _SIGN_IN_AGAIN)
        back = {"next": resolve_url(_SET_UP)}
    elif step == _SET_UP:
        messages.warning(request, "Maintainers of this site need two-factor authentication. Set it up first.")
        return redirect(step)
    elif request.method not in {"GET", "HEAD"}:
        return redirect(step)
    return redirect(f"{resolve_url(step)}?{urlencode(back)}")


def _name(request: HttpRequest) -> str:
    match = request.resolver_match
    return (match.url_name or "") if match else ""


def _is_guarded(request: HttpRequest) -> bool:
    """Tell whether it is a page of maintainers, or the one that sets up the app."""
    name = _name(request)
    if request.resolver_match and request.resolver_match.namespace == "admin":
        return name != "logout"
    return name.startswith("maintain") or name == _SET_UP


def _marked(request: HttpRequest, user: User | AnonymousUser) -> User | AnonymousUser:
    if user.is_authenticated:
        user.owes_a_code = bool(_missing_step(request, user))
    return user


def _missing_step(request: HttpRequest, user: User) -> str:
    if not second_factor.is_required(user):
        return ""
    given = {each.get("method") for each in get_authentication_records(request, user)}
    if second_factor.is_set_up(user):
        return "" if "mfa" in given else "mfa_reauthenticate"
    return _SET_UP if "code" in given else _SIGN_IN
