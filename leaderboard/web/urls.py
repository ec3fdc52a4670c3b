"""Addresses of the pages."""

from django.urls import include, path, register_converter
from django.views.generic import RedirectView

from leaderboard.keeping import kept, takes
from leaderboard.web import (
    analysis_views,
    audit_views,
    board_query,
    chart_views,
    compare_views,
    edition_views,
    export_views,
    maintainer_views,
    method_views,
    outside_views,
    queue_views,
    quota_views,
    receipt_views,
    team_views,
    token_views,
    views,
)

SAME_QUERY = {"query_string": True, "http_method_names": ["get", "head"]}
register_converter(export_views.FormConverter, "board_form")
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
    path("", kept(views.home, board_query.PARAMETERS), name="home"),
    path("board/<slug:split>/", kept(views.board, board_query.PARAMETERS), name="board"),
    path("board/<slug:split>/charts/", kept(chart_views.board_charts), name="charts"),
    path("board/<slug:split>/editions/", kept(edition_views.editions), name="editions"),
    path(
        "board/<slug:split>/editions/<int:number>/",
        kept(edition_views.edition, board_query.PARAMETERS),
        name="edition",
    ),
    # The API's own document, with the same query: there is one shape of a board.
    path(
        "board/<slug:split>.json", RedirectView.as_view(**SAME_QUERY, pattern_name="api-board"), name="json"
    ),
    path(
        "board/<slug:split>/editions/<int:number>.json",
        RedirectView.as_view(**SAME_QUERY, pattern_name="api-edition-board"),
        name="edition_json",
    ),
    path(
        "board/<slug:split>.<board_form:form>",
        kept(export_views.board, export_views.PARAMETERS),
        name="export",
    ),
    path(
        "board/<slug:split>/editions/<int:number>.<board_form:form>",
        kept(export_views.edition, export_views.PARAMETERS),
        name="edition_export",
    ),
    path("board/<slug:split>/feed.atom", kept(outside_views.feed), name="feed"),
    path("feed.atom", kept(outside_views.feed), name="feed_of_all"),
    path(
        "methods/<uuid:method_id>/badge.svg",
        kept(outside_views.badge, outside_views.PARAMETERS),
        name="badge",
    ),
    path("submit/", views.submit, name="submit"),
    path("submissions/", views.submissions, name="submissions"),
    path("submissions/<uuid:submission_id>/", views.submission, name="submission"),
    path("submissions/<uuid:submission_id>/analysis/", analysis_views.analysis, name="analysis"),
    path("submissions/<uuid:submission_id>/state/", views.submission_state, name="submission_state"),
    path("submissions/<uuid:submission_id>/receipt.json", receipt_views.receipt, name="receipt"),
    path("submissions/<uuid:submission_id>/withdraw/", views.withdraw, name="withdraw"),
    path("methods/<uuid:method_id>/", kept(views.method), name="method"),
    path("compare/", takes(compare_views.compare, compare_views.PARAMETERS), name="compare"),
    path("methods/<uuid:method_id>/edit/", method_views.edit, name="method_edit"),
    path("methods/<uuid:method_id>/visibility/", method_views.visibility, name="method_visibility"),
    path("team/", team_views.team, name="team"),
    path("team/invite/", team_views.invite, name="invite"),
    path(
        "team/invitations/<uuid:invitation_id>/revoke/",
        team_views.revoke_invitation,
        name="revoke_invitation",
    ),
    path("team/join/<str:secret>/", team_views.join, name="join_team"),
    path("team/leave/", team_views.leave, name="leave_team"),
    path("team/members/<uuid:handle>/hand-over/", team_views.hand_over, name="hand_over_team"),
    path("team/members/<uuid:handle>/remove/", team_views.remove, name="remove_member"),
    path("tokens/", token_views.tokens, name="tokens"),
    path("tokens/revoke/", token_views.revoke, name="revoke_token"),
    path("docs/", views.docs, name="docs"),
    path("docs/api/", views.api_reference, name="api_reference"),
    path("maintain/", maintainer_views.hub, name="maintain"),
    path("maintain/audit/", audit_views.events, name="maintain_audit"),
    path("maintain/audit/events.csv", audit_views.events_csv, name="maintain_audit_csv"),
    path("maintain/audit/events.json", audit_views.events_json, name="maintain_audit_json"),
    path("maintain/queue/", queue_views.queue, name="maintain_queue"),
    path("maintain/queue/state/", queue_views.queue_state, name="maintain_queue_state"),
    path("maintain/queue/retry/", queue_views.retry, name="maintain_retry"),
    path("maintain/quotas/", quota_views.quotas, name="maintain_quotas"),
    path("maintain/quotas/<uuid:team_id>/", quota_views.team_quotas, name="maintain_team_quotas"),
    path("maintain/quotas/<uuid:team_id>/<slug:split>/", quota_views.override, name="maintain_quota"),
    path(
        "maintain/quotas/<uuid:team_id>/<slug:split>/end/",
        quota_views.end_override,
        name="maintain_quota_end",
    ),
    path("maintain/<slug:split>/open/", maintainer_views.open_edition, name="maintain_open"),
    path("maintain/<slug:split>/editions/<int:number>/", include(MAINTAINED_EDITION)),
]
