"""Quotas for maintainers: the rules, teams with rules of their own, and what a team has left."""

from typing import Any, cast
from uuid import UUID

from django.conf import settings
from django.contrib import messages
from django.core.paginator import Paginator
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.views.decorators.http import require_safe

from leaderboard import quota_rules
from leaderboard import quotas as verbs
from leaderboard.models import QuotaOverride, Split, Team, User
from leaderboard.web import quota_tables as tables
from leaderboard.web.maintainer_views import asks_first, maintainers_only
from leaderboard.web.quota_forms import EndForm, OverrideForm, TeamLookup

PER_PAGE = 50


@maintainers_only
@require_safe
def quotas(request: HttpRequest) -> HttpResponse:
    """The rules of every split, the teams that have others, and a way to look up a team."""
    lookup = TeamLookup(request.GET)
    text = lookup.cleaned_data["team"] if lookup.is_valid() else ""
    found = tables.teams_like(text) if text else []
    page = Paginator(tables.overrides(), PER_PAGE).get_page(request.GET.get("page"))
    context = {
        "form": lookup,
        "text": text,
        "found": found[: tables.MAX_FOUND],
        "is_cut": len(found) > tables.MAX_FOUND,
        "splits": [(split, tables.rules_of(split)) for split in Split.objects.all()],
        "page": page,
        "overrides": [(row, tables.rules_of(row)) for row in page],
        "are_off": not settings.QUOTAS,
        "ignored": quota_rules.ignored(),
    }
    return render(request, "maintainers/quotas.html", context, status=400 if lookup.errors else 200)


@maintainers_only
@require_safe
def team_quotas(request: HttpRequest, team_id: UUID) -> HttpResponse:
    """What a team has spent and has left on every split, and by whose rules."""
    team = get_object_or_404(Team, pk=team_id)
    rows = tables.team_rows(team, viewer=_maintainer(request), now=timezone.now())
    context = {"team": team, "people": team.members.order_by("email"), "rows": rows}
    return render(request, "maintainers/team_quotas.html", {**context, "are_off": not settings.QUOTAS})


@maintainers_only
@asks_first
def override(request: HttpRequest, team_id: UUID, split: str) -> HttpResponse:
    """Give a team rules of its own on a split, or others than it has."""
    team, found = get_object_or_404(Team, pk=team_id), get_object_or_404(Split, pk=split)
    own = QuotaOverride.objects.filter(team=team, split=found).select_related("set_by").first()
    form = OverrideForm.asked(request, initial=OverrideForm.filled_with(own or found))
    if form.is_valid():
        actor, now = _maintainer(request), timezone.now()
        try:
            verbs.override(team=team, split=found, actor=actor, now=now, **form.cleaned_data)
        except Team.DoesNotExist:
            raise Http404 from None  # it has just ended
        messages.success(request, f"{team.name} has rules of its own on {split}.")
        return redirect("maintain_team_quotas", team.pk)
    return _form(request, "maintainers/quota_override.html", form, team=team, split=found, own=own)


@maintainers_only
@asks_first
def end_override(request: HttpRequest, team_id: UUID, split: str) -> HttpResponse:
    """Let the split's rules hold for a team again."""
    rows = QuotaOverride.objects.select_related("team", "split", "set_by")
    own = get_object_or_404(rows, team=team_id, split=split)
    form = EndForm.asked(request)
    if form.is_valid():
        verbs.end_override(row=own, actor=_maintainer(request), **form.cleaned_data)
        messages.success(request, f"The rules of {split} hold for {own.team.name} again.")
        return redirect("maintain_team_quotas", team_id)
    return _form(request, "maintainers/quota_end.html", form, team=own.team, split=own.split, own=own)


def _form(
    request: HttpRequest,
    template: str,
    form: OverrideForm | EndForm,
    *,
    team: Team,
    split: Split,
    own: QuotaOverride | None,
) -> HttpResponse:
    context: dict[str, Any] = {
        "form": form,
        "team": team,
        "split": split,
        "own": own,
        "rules": tables.rules_of(split),
        "own_rules": tables.rules_of(own) if own else None,
        "quota": verbs.state(team=team, user=_maintainer(request), split=split, now=timezone.now()),
    }
    return render(request, template, context, status=422 if form.errors else 200)


def _maintainer(request: HttpRequest) -> User:
    return cast("User", request.user)
