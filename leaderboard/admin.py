"""Django's admin, read-mostly; its actions call the domain functions that pages and commands call."""

from collections.abc import Sequence
from typing import Any, ClassVar, cast

from allauth.mfa import admin as _second_factors  # noqa: F401 - registers what is taken out below
from allauth.mfa.models import Authenticator
from allauth.socialaccount import admin as _connected  # noqa: F401 - the same
from allauth.socialaccount.models import SocialAccount, SocialApp, SocialToken
from django.contrib import admin, messages
from django.contrib.admin.models import LogEntry
from django.contrib.auth.admin import UserAdmin as DjangoUserAdmin
from django.db import transaction
from django.db.models import Model, QuerySet, URLField
from django.http import Http404, HttpRequest
from django.utils import timezone

from leaderboard import audit, versions
from leaderboard.models import (
    Admission,
    ApiToken,
    AuditEvent,
    Edition,
    Evaluation,
    GroundTruth,
    Invitation,
    Membership,
    Method,
    PublishedResult,
    QuotaOverride,
    Split,
    Submission,
    Team,
    User,
)
from leaderboard.people import tokens
from leaderboard.quotas import admissions


class ReadOnlyAdmin(admin.ModelAdmin):
    """Looks, does not touch: what these rows say is written by verbs."""

    formfield_overrides = {URLField: {"assume_scheme": "https"}}  # what Django 6 will do by itself

    def has_add_permission(self, request: HttpRequest) -> bool:
        """Nobody adds here."""
        return False

    def has_change_permission(self, request: HttpRequest, obj: Model | None = None) -> bool:
        """Nobody changes here."""
        return False

    def has_delete_permission(self, request: HttpRequest, obj: Model | None = None) -> bool:
        """Nobody deletes here."""
        return False


class AuditedAdmin(admin.ModelAdmin):
    """What is changed here is told to the audit log as well: which fields, and what these hold now."""

    audited_fields: ClassVar[Sequence[str]] = ()

    def log_addition(self, request: HttpRequest, obj: Model, message: Any) -> LogEntry:
        """Somebody added a row."""
        self._record(request, obj, verb="added", message=message)
        return super().log_addition(request, obj, message)

    def log_change(self, request: HttpRequest, obj: Model, message: Any) -> LogEntry:
        """Somebody changed a row, or an account's password."""
        self._record(request, obj, verb="changed", message=message)
        return super().log_change(request, obj, message)

    def log_deletions(self, request: HttpRequest, queryset: QuerySet[Any]) -> list[LogEntry]:
        """Somebody deleted rows."""
        for obj in queryset:
            self._record(request, obj, verb="deleted", message="")
        return super().log_deletions(request, queryset)

    def _record(self, request: HttpRequest, obj: Model, *, verb: str, message: Any) -> None:
        audit.record(
            verb=verb,
            noun=type(obj).__name__,
            noun_id=obj.pk,
            actor=cast("User", request.user),
            details={
                "said": message,
                **{name: str(getattr(obj, name)) for name in self.audited_fields},
            },
        )
        # What is changed here is rare, and may stand on any board. Most views are transactions; where one is
        # not, the sweep finds what a reader has drawn between the two.
        with transaction.atomic():
            versions.changed_everywhere()


@admin.register(Evaluation)
class EvaluationAdmin(ReadOnlyAdmin):
    """Every evaluation, decided ones as well; the queue's page retries system errors."""

    list_display = [
        "id",
        "submission",
        "edition",
        "status",
        "attempt",
        "queued_at",
        "finished_at",
        "last_error",
    ]
    list_filter = ["status", "edition"]
    search_fields = ["id", "submission__id", "submission__method__name", "submission__method__team__name"]
    list_select_related = ["submission__method", "edition"]
    date_hierarchy = "queued_at"


@admin.register(Submission)
class SubmissionAdmin(ReadOnlyAdmin):
    """Submissions of every team."""

    list_display = [
        "id",
        "split",
        "method",
        "submitted_by",
        "submitted_at",
        "via",
        "size_bytes",
        "withdrawn_at",
    ]
    list_filter = ["split", "via"]
    search_fields = ["id", "digest", "method__name", "method__team__name", "submitted_by__email"]
    list_select_related = ["method", "submitted_by"]


@admin.register(Split)
class SplitAdmin(AuditedAdmin):
    """A split's texts, times, quotas and decimals. Its published edition changes by publishing only."""

    list_display = ["name", "title", "listing", "is_hidden", "published_edition", "opens_at", "closes_at"]
    audited_fields = (
        "title",
        "listing",
        "needs_admission",
        "how_to_be_admitted",
        "opens_at",
        "closes_at",
        "quota_limit",
        "quota_window",
        "quota_min_gap",
        "quota_rejected_limit",
        "decimals",
    )
    readonly_fields = ["name", "published_edition", "is_hidden", "is_simulated", "same_truth_as"]

    def has_add_permission(self, request: HttpRequest) -> bool:
        """The page below /maintain/splits/ adds splits."""
        return False

    def has_delete_permission(self, request: HttpRequest, obj: Model | None = None) -> bool:
        """Splits stay."""
        return False


@admin.register(Admission)
class AdmissionAdmin(admin.ModelAdmin):
    """Teams that submit to a split by admission. Domain functions write them, with an audit event."""

    list_display = ["team", "split", "reason", "admitted_by", "admitted_at"]
    list_filter = ["split"]
    search_fields = ["team__name", "reason"]
    autocomplete_fields = ["team"]
    readonly_fields = ["admitted_by", "admitted_at"]

    def get_readonly_fields(self, request: HttpRequest, obj: Model | None = None) -> list[str]:
        """Whose it is stays."""
        fixed = super().get_readonly_fields(request, obj)
        return [*fixed, "team", "split"] if obj else list(fixed)

    def save_model(self, request: HttpRequest, obj: Admission, form: Any, change: bool) -> None:
        """Admit the team."""
        actor, now = cast("User", request.user), timezone.now()
        try:
            row = admissions.admit(team=obj.team, split=obj.split, reason=obj.reason, actor=actor, now=now)
        except Team.DoesNotExist:
            raise Http404 from None  # it has just ended
        obj.pk = row.pk

    def delete_model(self, request: HttpRequest, obj: Admission) -> None:
        """Take the admission back."""
        admissions.end(row=obj, actor=cast("User", request.user))

    def delete_queryset(self, request: HttpRequest, queryset: QuerySet[Admission]) -> None:
        """The same for many."""
        for row in queryset:
            self.delete_model(request, row)


@admin.register(Method)
class MethodAdmin(ReadOnlyAdmin):
    """Methods of every team. Who sees them is their teams' to decide."""

    list_display = ["name", "team", "visibility", "shown_at", "reveal_at", "created_at"]
    list_filter = ["visibility"]
    search_fields = ["id", "name", "team__name"]
    list_select_related = ["team"]


@admin.register(Team)
class TeamAdmin(ReadOnlyAdmin):
    """Teams."""

    list_display = ["name", "created_at"]
    search_fields = ["name"]


@admin.register(Invitation)
class InvitationAdmin(ReadOnlyAdmin):
    """Invitations, without their secrets."""

    list_display = [
        "team",
        "created_by",
        "created_at",
        "expires_at",
        "accepted_by",
        "accepted_at",
        "revoked_at",
    ]
    exclude = ["secret_hash"]
    search_fields = ["team__name", "created_by__email", "accepted_by__email"]
    list_select_related = ["team", "created_by", "accepted_by"]


@admin.register(ApiToken)
class ApiTokenAdmin(ReadOnlyAdmin):
    """Tokens, without their secrets."""

    list_display = ["name", "token_key", "user", "created", "expiry", "last_used_at", "revoked_at"]
    fields = [
        *("name", "token_key", "user", "may_read", "may_submit", "split"),
        *("created", "expiry", "last_used_at", "revoked_at"),
    ]
    search_fields = ["token_key", "name", "user__email"]
    list_select_related = ["user"]
    actions = ["revoke"]

    @admin.action(description="Revoke", permissions=["view"])
    def revoke(self, request: HttpRequest, queryset: QuerySet[ApiToken]) -> None:
        """End the chosen tokens at once."""
        actor = cast("User", request.user)
        n_revoked = sum(
            tokens.revoke(token=row, now=timezone.now(), actor=actor, how="by a maintainer")
            for row in queryset
        )
        self.message_user(request, f"Revoked: {n_revoked}.", messages.SUCCESS)


@admin.register(User)
class UserAdmin(AuditedAdmin, DjangoUserAdmin):
    """Accounts."""

    audited_fields = ("is_active", "is_staff", "is_superuser")  # no address: events stay for ever
    ordering = ["email"]
    list_display = ["email", "name", "is_staff", "is_active", "date_joined"]
    search_fields = ["email", "name"]
    fieldsets = [
        (None, {"fields": ["email", "password", "name"]}),
        ("Rights", {"fields": ["is_active", "is_staff", "is_superuser", "groups", "user_permissions"]}),
        ("Times", {"fields": ["last_login", "date_joined"]}),
    ]
    add_fieldsets = [
        (None, {"classes": ["wide"], "fields": ["email", "usable_password", "password1", "password2"]})
    ]

    def has_delete_permission(self, request: HttpRequest, obj: Model | None = None) -> bool:
        """Who is in a team leaves it first, which decides who owns it then."""
        if isinstance(obj, User) and Membership.objects.filter(user=obj).exists():
            return False
        return super().has_delete_permission(request, obj)


# What else maintainers do with overrides, and ask the audit log, they do at `/maintain/`.
for model in (AuditEvent, Edition, GroundTruth, Membership, PublishedResult, QuotaOverride):
    admin.site.register(model, ReadOnlyAdmin)

# A second factor is nobody else's to read or to change, and the providers are the settings' to name.
admin.site.unregister([Authenticator, SocialAccount, SocialApp, SocialToken])
