"""Django's admin shows what has no page, and changes nothing: accounts, addresses, tokens, invitations."""

from allauth.account import admin as _addresses  # noqa: F401 - registers what is taken out below
from allauth.account.models import EmailAddress
from allauth.mfa import admin as _second_factors  # noqa: F401 - the same
from allauth.socialaccount import admin as _connected  # noqa: F401 - the same
from django.contrib import admin
from django.contrib.auth import admin as _groups  # noqa: F401 - the same
from django.db.models import Model
from django.http import HttpRequest

from leaderboard.models import ApiToken, Invitation, User

# A second factor is nobody else's to read, the providers are the settings' to name, and groups do nothing.
for _model in tuple(admin.site._registry):
    admin.site.unregister(_model)


class ReadOnlyAdmin(admin.ModelAdmin):
    """Shows rows, changes none. `docs/maintainers.md` says where each thing is changed."""

    def has_add_permission(self, request: HttpRequest) -> bool:
        return False

    def has_change_permission(self, request: HttpRequest, obj: Model | None = None) -> bool:
        return False

    def has_delete_permission(self, request: HttpRequest, obj: Model | None = None) -> bool:
        return False


@admin.register(User)
class UserAdmin(ReadOnlyAdmin):
    ordering = ["email"]
    list_display = ["email", "name", "is_staff", "is_active", "date_joined"]
    list_filter = ["is_staff", "is_active"]
    fields = ["email", "name", "is_active", "is_staff", "is_superuser", "last_login", "date_joined"]
    search_fields = ["email", "name"]


@admin.register(EmailAddress)
class EmailAddressAdmin(ReadOnlyAdmin):
    list_display = ["email", "user", "primary", "verified"]
    search_fields = ["email", "user__email"]
    list_select_related = ["user"]


@admin.register(Invitation)
class InvitationAdmin(ReadOnlyAdmin):
    list_display = [
        *("team", "created_by", "created_at", "expires_at"),
        *("accepted_by", "accepted_at", "revoked_at"),
    ]
    exclude = ["secret_hash"]
    search_fields = ["team__name", "created_by__email", "accepted_by__email"]
    list_select_related = ["team", "created_by", "accepted_by"]


@admin.register(ApiToken)
class ApiTokenAdmin(ReadOnlyAdmin):
    list_display = ["name", "token_key", "user", "created", "expiry", "last_used_at", "revoked_at"]
    fields = [
        *("name", "token_key", "user", "may_read", "may_submit", "may_publish", "split"),
        *("created", "expiry", "last_used_at", "revoked_at"),
    ]
    search_fields = ["token_key", "name", "user__email"]
    list_select_related = ["user"]
