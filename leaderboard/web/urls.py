"""Addresses of the pages."""

from django.urls import include, path

from leaderboard.web import audit_views, edition_views, maintainer_views, token_views, views

MAINTAINED_EDITION = [
    path("", maintainer_views.edition, name="maintain_edition"),
    path("progress/", maintainer_views.edition_progress, name="maintain_progress"),
    path("preview.csv", maintainer_views.preview_csv, name="maintain_preview_csv"),
    path("preview.json", maintainer_views.preview_json, name="maintain_preview_json"),
    path("publish/", maintainer_views.publish, name="maintain_publish"),
    path("roll-back/", maintainer_views.roll_back, name="maintain_roll_back"),
    path("discard/", maintainer_views.discard, name="maintain_discard"),
]
urlpatterns = [
    path("", views.home, name="home"),
    path("board/<slug:split>/", views.board, name="board"),
    path("board/<slug:split>/editions/", edition_views.editions, name="editions"),
    path("board/<slug:split>/editions/<int:number>/", edition_views.edition, name="edition"),
    path("submit/", views.submit, name="submit"),
    path("submissions/", views.submissions, name="submissions"),
    path("submissions/<uuid:submission_id>/", views.submission, name="submission"),
    path("submissions/<uuid:submission_id>/state/", views.submission_state, name="submission_state"),
    path("submissions/<uuid:submission_id>/withdraw/", views.withdraw, name="withdraw"),
    path("methods/<uuid:method_id>/", views.method, name="method"),
    path("tokens/", token_views.tokens, name="tokens"),
    path("tokens/revoke/", token_views.revoke, name="revoke_token"),
    path("docs/", views.docs, name="docs"),
    path("docs/api/", views.api_reference, name="api_reference"),
    path("maintain/", maintainer_views.hub, name="maintain"),
    path("maintain/audit/", audit_views.events, name="maintain_audit"),
    path("maintain/audit/events.csv", audit_views.events_csv, name="maintain_audit_csv"),
    path("maintain/audit/events.json", audit_views.events_json, name="maintain_audit_json"),
    path("maintain/<slug:split>/open/", maintainer_views.open_edition, name="maintain_open"),
    path("maintain/<slug:split>/editions/<int:number>/", include(MAINTAINED_EDITION)),
]
