"""Addresses of the API, version 1."""

from django.urls import path
from drf_spectacular.views import SpectacularAPIView, SpectacularRedocView
from rest_framework.permissions import AllowAny

from leaderboard.api import views

urlpatterns = [
    path("submissions", views.SubmissionsView.as_view(), name="api-submissions"),
    path("submissions/<uuid:submission_id>", views.SubmissionView.as_view(), name="api-submission"),
    path("splits", views.SplitsView.as_view(), name="api-splits"),
    path("splits/<slug:split>/board", views.BoardView.as_view(), name="api-board"),
    path("splits/<slug:split>/manifest", views.ManifestView.as_view(), name="manifest"),
    path("schema", SpectacularAPIView.as_view(permission_classes=[AllowAny]), name="api-schema"),
    path(
        "docs",
        SpectacularRedocView.as_view(url_name="api-schema", permission_classes=[AllowAny]),
        name="api-docs",
    ),
]
