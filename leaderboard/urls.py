"""Addresses: pages, API, administration, accounts, and those for monitoring."""

from django.contrib import admin
from django.urls import include, path

from leaderboard.web import health

urlpatterns = [
    path("", include("leaderboard.web.urls")),
    path("api/v1/", include("leaderboard.api.urls")),
    path("accounts/", include("allauth.urls")),
    path("admin/", admin.site.urls),
    path("healthz", health.healthz, name="healthz"),
    path("readyz", health.readyz, name="readyz"),
    path("metrics", health.prometheus, name="metrics"),
]

# What no view has handled: an outage is told as such, everything else is a 500.
handler500 = "leaderboard.web.outages.server_error"
