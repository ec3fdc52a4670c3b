"""Addresses of the pages."""

from django.urls import path

from leaderboard.web import views

urlpatterns = [
    path("", views.home, name="home"),
    path("board/<slug:split>/", views.board, name="board"),
    path("board/<slug:split>/editions/<int:number>/", views.edition, name="edition"),
    path("submit/", views.submit, name="submit"),
    path("submissions/", views.submissions, name="submissions"),
    path("submissions/<uuid:submission_id>/", views.submission, name="submission"),
    path("submissions/<uuid:submission_id>/state/", views.submission_state, name="submission_state"),
    path("methods/<uuid:method_id>/", views.method, name="method"),
    path("docs/", views.docs, name="docs"),
    path("docs/api/", views.api_reference, name="api_reference"),
]
