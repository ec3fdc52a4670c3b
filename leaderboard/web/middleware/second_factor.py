"""Where `TSTTC_REQUIRE_SECOND_FACTOR` is on, the maintainers' pages open to a second factor alone."""

from collections.abc import Callable
from typing import Any

from django.contrib import messages
from django.http import HttpRequest, HttpResponse, HttpResponseBase
from django.shortcuts import redirect, resolve_url
from django.utils.http import urlencode
from django_htmx.http import HttpResponseClientRefresh

from leaderboard.web.account.second_factor import missing_step


class SecondFactorMiddleware:
    """Leads from `/maintain/` and `/admin/` to the page that sets up the second factor, or asks for it."""

    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self._get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        """Nothing to do before the address is resolved."""
        return self._get_response(request)

    def process_view(
        self, request: HttpRequest, view: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]
    ) -> HttpResponseBase | None:
        """Redirect, or let the view answer."""
        if not _is_for_maintainers(request) or not request.user.is_authenticated:
            return None
        step = missing_step(request, request.user)
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
