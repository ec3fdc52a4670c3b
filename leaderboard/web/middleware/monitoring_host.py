"""The addresses for monitoring answer whatever name a request gives the site.

Prometheus and load balancers send the address that they connect to, such as `web:8000`. Nothing in these
answers depends on the name.
"""

from collections.abc import Callable
from typing import Final
from urllib.parse import urlsplit

from django.conf import settings
from django.http import HttpRequest, HttpResponse

ADDRESSES: Final = frozenset({"/healthz", "/readyz", "/healthy", "/metrics"})


class MonitoringHostMiddleware:
    def __init__(self, get_response: Callable[[HttpRequest], HttpResponse]) -> None:
        self.get_response = get_response

    def __call__(self, request: HttpRequest) -> HttpResponse:
        if request.path_info in ADDRESSES:
            request.META["HTTP_HOST"] = urlsplit(settings.SITE_URL).netloc
        return self.get_response(request)
