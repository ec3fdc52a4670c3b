"""Addresses of the pages."""

from django.urls import include, path, register_converter

from leaderboard.http_caching import cacheable
from leaderboard.web.account import data_views, overview_views, team_views, token_views
from leaderboard.web.boards import board_views, export_views, public_assets
from leaderboard.web.charts import chart_views, paper_charts
from leaderboard.web.compare import compare_views
from leaderboard.web.docs import docs_views
from leaderboard.web.landing import crawler_views, landing_views
from leaderboard.web.maintain import (
    audit_views,
    edited_page_views,
    mail_views,
    maintainer_views,
    moderation_views,
    published_views,
    queue_views,
    quota_views,
    split_views,
    team_list_views,
)
from leaderboard.web.methods import method_views
from leaderboard.web.submissions import submission_views

register_converter(export_views.FormatConverter, "export_format")
register_converter(docs_views.PageConverter, "page")
MAINTAINED_EDITION = [
    path("", maintainer_views.edition, name="maintain_edition"),
    path("progress/", maintainer_views.edition_progress, name="maintain_progress"),
    path("preview.csv", maintainer_views.preview_csv, name="maintain_preview_csv"),
    path("publish/", maintainer_views.publish, name="maintain_publish"),
    path("roll-back/", maintainer_views.roll_back, name="maintain_roll_back"),
    path("discard/", maintainer_views.discard, name="maintain_discard"),
]
urlpatterns = [
    path("", cacheable(landing_views.home), name="home"),
    path("board/", landing_views.main_board, name="main_board"),
    path("board/<slug:split>/", cacheable(board_views.board), name="board"),
    path("board/<slug:split>/charts/", chart_views.charts, name="charts"),
    path(
        "board/<slug:split>/charts/progress.json",
        cacheable(chart_views.progress_options),
        name="progress_options",
    ),
    path("board/<slug:split>/editions/", cacheable(board_views.editions), name="editions"),
    path(
        "board/<slug:split>/editions/<int:number>/",
        cacheable(board_views.edition),
        name="edition",
    ),
    path(
        "board/<slug:split>.<export_format:chosen>",
        cacheable(export_views.board),
        name="export",
    ),
    path(
        "board/<slug:split>/editions/<int:number>.<export_format:chosen>",
        cacheable(export_views.edition),
        name="edition_export",
    ),
    path("board/<slug:split>/feed.atom", cacheable(public_assets.feed), name="feed"),
    path("feed.atom", cacheable(public_assets.feed), name="feed_of_all"),
    path(
        "methods/<uuid:method_id>/badge.svg",
        cacheable(public_assets.badge),
        name="badge",
    ),
    path("robots.txt", crawler_views.robots, name="robots"),
    path("sitemap.xml", cacheable(crawler_views.sitemap), name="sitemap"),
    path("favicon.ico", crawler_views.favicon, name="favicon"),
    path("submit/", submission_views.submit, name="submit"),
    path("submit/template/<slug:split>.json", submission_views.template, name="template"),
    path("submissions/", submission_views.submission_list, name="submissions"),
    path("submissions/<uuid:submission_id>/", submission_views.submission, name="submission"),
    path("submissions/<uuid:submission_id>/analysis/", submission_views.analysis, name="analysis"),
    path(
        "submissions/<uuid:submission_id>/state/", submission_views.submission_state, name="submission_state"
    ),
    path("submissions/<uuid:submission_id>/receipt.jwt", submission_views.receipt, name="receipt"),
    path("submissions/<uuid:submission_id>/withdraw/", submission_views.withdraw, name="withdraw"),
    path("submissions/<uuid:submission_id>/move/", submission_views.move, name="submission_move"),
    path("methods/<uuid:method_id>/", method_views.method, name="method"),
    path("compare/", compare_views.compare, name="compare"),
    path("methods/<uuid:method_id>/edit/", method_views.edit, name="method_edit"),
    path("methods/<uuid:method_id>/delete/", method_views.delete, name="method_delete"),
    path("methods/<uuid:method_id>/visibility/", method_views.change_visibility, name="method_visibility"),
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
    path("account/", overview_views.overview, name="account"),
    path("account/data/", data_views.data, name="account_data"),
    path("account/data.json", data_views.download, name="account_data_download"),
    path("tokens/", token_views.token_page, name="tokens"),
    path("mails/", data_views.mails, name="mails"),
    path("tokens/revoke/", token_views.revoke, name="revoke_token"),
    path("docs/", docs_views.docs, name="docs"),
    path("docs/api/", docs_views.api_page, name="api_reference"),
    path("docs/api/<slug:operation_id>/", docs_views.api_operation, name="api_operation"),
    path("docs/search/", docs_views.find, name="docs_search"),
    path("docs/<path:guide_name>/", docs_views.guide, name="guide"),
    path("published/", paper_charts.published_page, name="published"),
    path(
        "published/<slug:table_name>.<slug:suffix>",
        paper_charts.published_table,
        name="published_table",
    ),
    path("dist/", docs_views.dist, name="dist"),
    path("dist/<str:wheel_name>", docs_views.dist_file, name="dist_file"),
    path("<page:page_name>/", docs_views.site_page, name="site_page"),
    path("maintain/", maintainer_views.hub, name="maintain"),
    path("maintain/pages/", edited_page_views.site_pages, name="maintain_pages"),
    path("maintain/pages/<page:page_name>/", edited_page_views.site_page, name="maintain_page"),
    path("maintain/mails/", mail_views.mails, name="maintain_mails"),
    path("maintain/audit/", audit_views.events, name="maintain_audit"),
    path("maintain/audit/events.json", audit_views.export, name="maintain_audit_json"),
    path("maintain/queue/", queue_views.queue, name="maintain_queue"),
    path("maintain/queue/state/", queue_views.queue_state, name="maintain_queue_state"),
    path("maintain/queue/retry/", queue_views.retry, name="maintain_retry"),
    path("maintain/quotas/", quota_views.quota_rules, name="maintain_quotas"),
    path("maintain/quotas/<uuid:team_id>/", quota_views.team_quotas, name="maintain_team_quotas"),
    path("maintain/quotas/<uuid:team_id>/<slug:split>/", quota_views.override, name="maintain_quota"),
    path(
        "maintain/quotas/<uuid:team_id>/<slug:split>/end/",
        quota_views.end_override,
        name="maintain_quota_end",
    ),
    path("maintain/admissions/<uuid:team_id>/<slug:split>/", quota_views.admit, name="maintain_admit"),
    path(
        "maintain/admissions/<uuid:team_id>/<slug:split>/end/",
        quota_views.end_admission,
        name="maintain_admission_end",
    ),
    path("maintain/teams/", team_list_views.team_list, name="maintain_teams"),
    path("maintain/teams/<uuid:team_id>/", moderation_views.team, name="maintain_team"),
    path(
        "maintain/actions/<slug:action_name>/<slug:subject_id>/",
        moderation_views.action,
        name="maintain_action",
    ),
    path("maintain/published/", published_views.published, name="maintain_published"),
    path(
        "maintain/published/<slug:split>/<slug:slug>/remove/",
        published_views.remove,
        name="maintain_published_remove",
    ),
    path("maintain/splits/", split_views.splits, name="maintain_splits"),
    path("maintain/announcement/", split_views.announcement, name="maintain_announcement"),
    path("maintain/splits/add/", split_views.add, name="maintain_split_add"),
    path("maintain/splits/<slug:split>/mail/", split_views.mail, name="maintain_mail"),
    path("maintain/splits/<slug:split>/", split_views.change, name="maintain_split"),
    path("maintain/<slug:split>/open/", maintainer_views.open_edition, name="maintain_open"),
    path("maintain/<slug:split>/editions/<int:number>/", include(MAINTAINED_EDITION)),
]
