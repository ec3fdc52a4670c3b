"""The leaderboard's addresses and that of a view which does nothing: what every request costs at least."""

from django.http import HttpRequest, HttpResponse
from django.urls import include, path


def empty(request: HttpRequest) -> HttpResponse:
    """Nothing, through every middleware."""
    return HttpResponse(b"", content_type="application/json")


urlpatterns = [path("empty", empty), path("", include("leaderboard.urls"))]
