"""Django's admin, read-mostly; its actions call the same verbs as every other door."""

from typing import Any

from django.contrib import admin, messages
from django.contrib.auth.admin import UserAdmin as DjangoUserAdmin
from django.db.models import Model, QuerySet
from django.http import HttpRequest, HttpResponse

from leaderboard import lifecycle
from leaderboard.models import (
    ApiToken,
    AuditEvent,
    Edition,
    Evaluation,
    GroundTruth,
    Membership,
    Method,
    PublishedResult,
    Split,
    Status,
    Submission,
    Team,
    User,
)


class ReadOnlyAdmin(admin.ModelAdmin):
    """Looks, does not touch: what these rows say is written by verbs."""

    def has_add_permission(self, request: HttpRequest) -> bool:
        """Nobody adds here."""
        return False

    def has_change_permission(self, request: HttpRequest, obj: Model | None = None) -> bool:
        """Nobody changes here."""
        return False

    def has_delete_permission(self, request: HttpRequest, obj: Model | None = None) -> bool:
        """Nobody deletes here."""
        return False


@admin.register(Evaluation)
class EvaluationAdmin(ReadOnlyAdmin):
    """The queue: what waits, what runs, what failed by our fault."""

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
    actions = ["retry"]

    def changelist_view(
        self, request: HttpRequest, extra_context: dict[str, Any] | None = None
    ) -> HttpResponse:
        """The list, headed by how many wait for a maintainer."""
        n_failed = Evaluation.objects.filter(status=Status.SYSTEM_ERROR).count()
        heading = f"{n_failed} failed by our fault and wait to be retried" if n_failed else None
        return super().changelist_view(request, {"subtitle": heading, **(extra_context or {})})

    @admin.action(description="Retry system errors", permissions=["retry"])
    def retry(self, request: HttpRequest, queryset: QuerySet[Evaluation]) -> None:
        """Queue the chosen system errors again."""
        n_retried = 0
        for evaluation in queryset:
            try:
                lifecycle.retry(evaluation=evaluation, actor=request.user, reason="from the administration")  # type: ignore[arg-type]  # the admin lets no anonymous user in
                n_retried += 1
            except lifecycle.LostRace as race:
                self.message_user(request, str(race), messages.WARNING)
        self.message_user(request, f"Queued again: {n_retried}.", messages.SUCCESS)

    def has_retry_permission(self, request: HttpRequest) -> bool:
        """Maintainers who may look at evaluations may retry them."""
        return self.has_view_permission(request)


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
class SplitAdmin(admin.ModelAdmin):
    """A split's texts and times. Its published edition changes by publishing only."""

    list_display = ["name", "title", "is_hidden", "published_edition", "opens_at", "closes_at"]
    readonly_fields = ["name", "published_edition", "is_hidden", "is_simulated"]

    def has_add_permission(self, request: HttpRequest) -> bool:
        """Splits come with the benchmark."""
        return False

    def has_delete_permission(self, request: HttpRequest, obj: Model | None = None) -> bool:
        """Splits stay."""
        return False


@admin.register(Method)
class MethodAdmin(ReadOnlyAdmin):
    """Methods of every team."""

    list_display = ["name", "team", "visibility", "created_at"]
    search_fields = ["name", "team__name"]


@admin.register(Team)
class TeamAdmin(ReadOnlyAdmin):
    """Teams."""

    list_display = ["name", "created_at"]
    search_fields = ["name"]


@admin.register(ApiToken)
class ApiTokenAdmin(ReadOnlyAdmin):
    """Tokens, without their secrets."""

    list_display = ["name", "token_key", "user", "created", "expiry"]
    fields = ["name", "token_key", "user", "created", "expiry"]


@admin.register(User)
class UserAdmin(DjangoUserAdmin):
    """Accounts."""

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


for model in (AuditEvent, Edition, GroundTruth, Membership, PublishedResult):
    admin.site.register(model, ReadOnlyAdmin)
