"""Headers of every response: caching, variation, and browser permissions.

An answer to a session or token is `private, no-store`; any other may be revalidated, unless its view says
more.
"""

from collections.abc import Callable
from typing import Final

from django.conf import settings
from django.http import HttpRequest, HttpResponse
from django.utils.cache import patch_vary_headers

ONES_OWN: Final = "private, no-store"
ANYBODYS: Final = "public, no-cache"
FAULTS: Final = "no-store"
VARY: Final = ("Cookie", "Authorization")
# Nothing here films, listens, locates or pays, and nothing that is embedded could.
PERMISSIONS: Final = ", ".join(
    f"{feature}=()"
    for feature in (
        *("accelerometer", "autoplay", "camera", "display-capture", "encrypted-media", "fullscreen"),
        *("geolocation", "gyroscope", "magnetometer", "microphone", "midi", "payment"),
        *(
            "picture-in-picture",
            "publickey-credentials-get",
            "screen-wake-lock",
            "usb",
            "xr-spatial-tracking",
        ),
    )
)


class HeadersMiddleware:
    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self._get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        response = self._get_response(request)
        response.headers.setdefault("Permissions-Policy", PERMISSIONS)
        # A view whose picture others show, as a badge, says `cross-origin`.
        response.headers.setdefault("Cross-Origin-Resource-Policy", "same-origin")
        if not request.path_info.startswith(settings.STATIC_URL):
            patch_vary_headers(response, VARY)
            self._say_who_may_keep(request, response)
        return response

    @staticmethod
    def _say_who_may_keep(request: HttpRequest, response: HttpResponse) -> None:
        cache_control = response.headers.get("Cache-Control", "")
        if _is_ones_own(request, response) or "no-store" in cache_control:
            response.headers["Cache-Control"] = ONES_OWN
            response.headers.pop("Expires", None)
        elif not cache_control:
            response.headers["Cache-Control"] = ANYBODYS if response.status_code < 400 else FAULTS


def _is_ones_own(request: HttpRequest, response: HttpResponse) -> bool:
    """Tell whether the request identifies its user, changes something, or sets a cookie."""
    return (
        settings.SESSION_COOKIE_NAME in request.COOKIES
        or "HTTP_AUTHORIZATION" in request.META
        or request.method not in {"GET", "HEAD"}
        or bool(response.cookies)
    )
