"""Addresses of the API, version 1."""

from django.urls import path
from django.views.generic import RedirectView

from leaderboard.api import (
    account_views,
    board_views,
    compare_views,
    edition_views,
    method_views,
    published_views,
    receipt_views,
    schema,
    submission_views,
    views,
)
from leaderboard.http_caching import cacheable

_TO_THE_REFERENCE = RedirectView.as_view(
    pattern_name="api_reference", http_method_names=["get", "head", "options"]
)

urlpatterns = [
    path("", _TO_THE_REFERENCE, name="api-root"),
    path("submissions", submission_views.SubmissionsView.as_view(), name="api-submissions"),
    path(
        "submissions/<uuid:submission_id>", submission_views.SubmissionView.as_view(), name="api-submission"
    ),
    path("submissions/<uuid:submission_id>/receipt", receipt_views.ReceiptView.as_view(), name="api-receipt"),
    path("methods", method_views.MethodsView.as_view(), name="api-methods"),
    path("methods/<uuid:method_id>", cacheable(method_views.MethodView.as_view()), name="api-method"),
    path(
        "methods/<uuid:method_id>/visibility",
        method_views.VisibilityView.as_view(),
        name="api-method-visibility",
    ),
    path("submissions/<uuid:submission_id>/file", receipt_views.FileView.as_view(), name="api-file"),
    path("account", account_views.AccountView.as_view(), name="api-account"),
    path("quota", account_views.QuotaView.as_view(), name="api-quota"),
    path("tokens/revoke", account_views.RevokeView.as_view(), name="api-revoke-token"),
    path("compare", compare_views.CompareView.as_view(), name="api-compare"),
    path("splits", cacheable(views.SplitsView.as_view()), name="api-splits"),
    path(
        "splits/<slug:split>/board",
        cacheable(board_views.BoardView.as_view()),
        name="api-board",
    ),
    path("submissions/<uuid:submission_id>/withdraw", views.WithdrawView.as_view(), name="api-withdraw"),
    path("submissions/<uuid:submission_id>/move", views.MoveView.as_view(), name="api-move"),
    path(
        "splits/<slug:split>/editions",
        cacheable(edition_views.EditionsView.as_view()),
        name="api-editions",
    ),
    path(
        "splits/<slug:split>/editions/<int:number>/board",
        cacheable(board_views.EditionBoardView.as_view()),
        name="api-edition-board",
    ),
    path(
        "splits/<slug:split>/editions/<int:number>/progress",
        edition_views.ProgressView.as_view(),
        name="api-edition-progress",
    ),
    path(
        "splits/<slug:split>/editions/<int:number>/preview",
        edition_views.PreviewView.as_view(),
        name="api-edition-preview",
    ),
    path(
        "splits/<slug:split>/changelog",
        cacheable(edition_views.ChangelogView.as_view()),
        name="api-changelog",
    ),
    path("splits/<slug:split>/manifest", views.ManifestView.as_view(), name="manifest"),
    path("splits/<slug:split>/croissant", views.CroissantView.as_view(), name="api-croissant"),
    path(
        "published",
        published_views.PublishedTablesView.as_view(),
        name="api-published-tables",
    ),
    path(
        "published/<slug:name>",
        published_views.PublishedTableView.as_view(),
        name="api-published-table",
    ),
    path("schema", schema.SchemaView.as_view(), name="api-schema"),
    path("docs", _TO_THE_REFERENCE, name="api-docs"),
]
