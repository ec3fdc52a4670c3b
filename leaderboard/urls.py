"""Addresses: pages, API, administration, accounts, and those for monitoring."""

from allauth.account.decorators import secure_admin_login
from django.contrib import admin
from django.urls import include, path, re_path

from leaderboard.api.exceptions import UnknownAddressView
from leaderboard.web import monitoring
from leaderboard.web.account import entrance_views, identity, providers, undo_views
from leaderboard.web.submissions import submission_views

# Its own form knows no limit of how often one may guess.
admin.site.login = secure_admin_login(admin.site.login)  # type: ignore[method-assign]  # the way that allauth documents

urlpatterns = [
    path("", include("leaderboard.web.urls")),
    path("api/v1/", include("leaderboard.api.urls")),
    re_path(r"^api(/|$)", UnknownAddressView.as_view()),
    path(".well-known/tsttc-receipt-keys.json", submission_views.receipt_keys, name="receipt_keys"),
    path("accounts/reauthenticate/code/", identity.MailedCodeView.as_view(), name=identity.URL_NAME),
    path("accounts/confirm-email/", entrance_views.confirm_address, name="account_email_verification_sent"),
    path("accounts/email/", entrance_views.own_addresses, name="account_email"),
    path("accounts/undo/<str:secret>/", undo_views.undo, name="account_undo"),
    path("accounts/password/set/", identity.set_password, name="account_set_password"),
    path("accounts/", include("allauth.account.urls")),
    path("accounts/2fa/", include("allauth.mfa.urls")),
    path("accounts/", include(providers.patterns())),
    path("admin/", admin.site.urls),
    path("healthz", monitoring.healthz, name="healthz"),
    path("readyz", monitoring.readyz, name="readyz"),
    path("healthy", monitoring.healthy, name="healthy"),
    path("metrics", monitoring.exposition, name="metrics"),
]

# What no view has handled: an outage is told as such, everything else is a 500.
handler400 = "leaderboard.web.error_pages.bad_request"
handler500 = "leaderboard.web.error_pages.server_error"
