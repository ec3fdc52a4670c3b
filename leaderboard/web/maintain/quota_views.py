"""Quotas for maintainers: rules, overrides, admissions."""

from collections.abc import Mapping
from typing import Any
from uuid import UUID

from django.conf import settings
from django.contrib import messages
from django.core.paginator import Paginator
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.views.decorators.http import require_safe

from leaderboard.models import Admission, QuotaOverride, Split, Team
from leaderboard.quotas import admissions, usage
from leaderboard.web.maintain import quota_tables
from leaderboard.web.maintain.maintainer_views import (
    form_page,
    maintainer_of,
    maintainers_form,
    maintainers_only,
)
from leaderboard.web.maintain.quota_forms import EndForm, OverrideForm

PER_PAGE = 50


@maintainers_only
@require_safe
def quota_rules(request: HttpRequest) -> HttpResponse:
    overrides = QuotaOverride.objects.select_related("team", "split", "set_by")
    overrides = overrides.order_by("split__position", "split", "team__name")
    page = Paginator(overrides, PER_PAGE).get_page(request.GET.get("page"))
    context = {
        "splits": [(split, quota_tables.rules_of(split)) for split in Split.objects.all()],
        "page": page,
        "overrides": [(row, quota_tables.rules_of(row) | {"spoken": _spoken(row)}) for row in page],
        "are_off": not settings.QUOTAS,
    }
    return render(request, "maintain/quotas.html", context)


@maintainers_only
@require_safe
def team_quotas(request: HttpRequest, team_id: UUID) -> HttpResponse:
    team = get_object_or_404(Team, pk=team_id)
    rows = quota_tables.team_rows(team, viewer=maintainer_of(request), now=timezone.now())
    context = {"team": team, "people": team.members.order_by("email"), "rows": rows}
    return render(request, "maintain/team_quotas.html", {**context, "are_off": not settings.QUOTAS})


@maintainers_form
def override(request: HttpRequest, team_id: UUID, split: str) -> HttpResponse:
    team, split_row = get_object_or_404(Team, pk=team_id), get_object_or_404(Split, pk=split)
    own = QuotaOverride.objects.filter(team=team, split=split_row).select_related("set_by").first()
    form = OverrideForm.asked(request, initial=OverrideForm.filled_with(own or split_row))
    if form.is_valid():
        actor, now = maintainer_of(request), timezone.now()
        try:
            usage.override(team=team, split=split_row, actor=actor, now=now, **form.rules())
        except Team.DoesNotExist:
            raise Http404 from None  # it has just ended
        messages.success(request, f"{team.name} now has an override on {split}.")
        return redirect("maintain_team_quotas", team.pk)
    lead = "An override replaces the rules of the split from the next submission."
    words = {"heading": "Override for", "lead": lead, "button": "Save"}
    return _form(request, form, team=team, split=split_row, own=own, words=words)


@maintainers_form
def end_override(request: HttpRequest, team_id: UUID, split: str) -> HttpResponse:
    rows = QuotaOverride.objects.select_related("team", "split", "set_by")
    own = get_object_or_404(rows, team=team_id, split=split)
    form = EndForm.asked(request)
    if form.is_valid():
        usage.end_override(row=own, actor=maintainer_of(request), **form.cleaned_data)
        messages.success(request, f"The rules of {split} hold for {own.team.name} again.")
        return redirect("maintain_team_quotas", team_id)
    lead = "The rules of the split apply to the team again from the next submission."
    words = {"heading": "Delete the override for", "lead": lead, "button": "Delete override"}
    return _form(request, form, team=own.team, split=own.split, own=own, words={**words, "destroys": True})


@maintainers_form
def admit(request: HttpRequest, team_id: UUID, split: str) -> HttpResponse:
    team, split_row = get_object_or_404(Team, pk=team_id), get_object_or_404(Split, pk=split)
    form = EndForm.asked(request)
    if form.is_valid():
        actor, now = maintainer_of(request), timezone.now()
        try:
            admissions.admit(team=team, split=split_row, actor=actor, now=now, **form.cleaned_data)
        except Team.DoesNotExist:
            raise Http404 from None  # it has just ended
        messages.success(request, f"{team.name} is admitted to {split}.")
        return redirect("maintain_team_quotas", team.pk)
    lead = "Once admitted, the team can submit whenever the split is open."
    words = {"heading": "Admit a team", "lead": lead, "button": "Admit"}
    subject = f"{team.name} on {split_row.title}"
    return form_page(request, "maintain/action.html", form, team=team, subject=subject, **_asked(team, words))


@maintainers_form
def end_admission(request: HttpRequest, team_id: UUID, split: str) -> HttpResponse:
    row = get_object_or_404(Admission.objects.select_related("team"), team=team_id, split=split)
    form = EndForm.asked(request)
    if form.is_valid():
        admissions.end(row=row, actor=maintainer_of(request), **form.cleaned_data)
        messages.success(request, f"{row.team.name} is not admitted to {split} any more.")
        return redirect("maintain_team_quotas", team_id)
    lead = "The team can submit nothing more to the split. What it sent stays."
    words = {"heading": "Revoke an admission", "lead": lead, "button": "Revoke the admission"}
    subject = f"{row.team.name} on {split}"
    return form_page(
        request, "maintain/action.html", form, team=row.team, subject=subject, **_asked(row.team, words)
    )


def _spoken(row: QuotaOverride) -> str:
    """Return what tells the links to an override apart for who hears them."""
    return f" the override for {row.team.name} on {row.split_id}"


def _asked(team: Team, words: Mapping[str, str]) -> dict[str, Any]:
    """Return the words of a page that asks before an action, and the way back to the team."""
    return {"action": words, "back": reverse("maintain_team", args=[team.pk])}


def _form(
    request: HttpRequest,
    form: OverrideForm | EndForm,
    *,
    team: Team,
    split: Split,
    own: QuotaOverride | None,
    words: Mapping[str, str | bool],
) -> HttpResponse:
    quota = usage.state(team=team, user=maintainer_of(request), split=split, now=timezone.now())
    about = {
        "team": team,
        "split": split,
        "own": own,
        "quota": quota,
        "rules": quota_tables.sentence_of(split),
        "own_rules": quota_tables.sentence_of(own) if own else "",
    }
    return form_page(request, "maintain/quota_form.html", form, **about, **words)
