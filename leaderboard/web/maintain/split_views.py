"""Splits for maintainers: all of them, a new one, and the policy of one."""

from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.views.decorators.http import require_safe

from leaderboard.benchmark import policy
from leaderboard.benchmark.policy import Policy
from leaderboard.editions import new_splits
from leaderboard.models import Split
from leaderboard.quotas import deadlines
from leaderboard.web.maintain import quota_tables
from leaderboard.web.maintain.maintainer_views import asks_first, form_page, maintainer_of, maintainers_only
from leaderboard.web.maintain.split_forms import AnnouncementForm, NewSplitForm, PolicyForm


@maintainers_only
@require_safe
def splits(request: HttpRequest) -> HttpResponse:
    """Every split, also those that are switched off."""
    now = timezone.now()
    rows = [
        (split, deadlines.sentence_of(split, now=now) or "Open.", quota_tables.sentence_of(split))
        for split in Split.objects.select_related("published_edition")
    ]
    return render(request, "maintain/splits.html", {"rows": rows})


@maintainers_only
@asks_first
def add(request: HttpRequest) -> HttpResponse:
    """Make a split."""
    form = NewSplitForm.asked(request, initial=PolicyForm.filled_with(Policy(title="")))
    if form.is_valid():
        with form.refusals():
            split = new_splits.add_split(now=timezone.now(), actor=maintainer_of(request), **form.wanted())
            messages.success(request, f"The split {split.pk} was added.")
            return redirect("maintain_splits")
    return form_page(request, "maintain/split_form.html", form)


@maintainers_only
@asks_first
def change(request: HttpRequest, split: str) -> HttpResponse:
    """Change the policy of a split."""
    found = get_object_or_404(Split, pk=split)
    form = PolicyForm.asked(request, initial=PolicyForm.filled_with(policy.policy_of(found)))
    if form.is_valid():
        with form.refusals():
            policy.change(split_name=split, policy=form.policy(), actor=maintainer_of(request))
            messages.success(request, f"The split {split} was changed.")
            return redirect("maintain_splits")
    return form_page(request, "maintain/split_form.html", form, split=found)


@maintainers_only
@asks_first
def announcement(request: HttpRequest) -> HttpResponse:
    """Show a line on the pages of every split, or take it away."""
    form = AnnouncementForm.asked(request)
    if form.is_valid():
        with form.refusals():
            text, ends_at = form.cleaned_data["announcement"], form.cleaned_data["announcement_ends_at"]
            policy.announce(text=text, ends_at=ends_at, now=timezone.now(), actor=maintainer_of(request))
            messages.success(request, "The announcement was changed on all splits.")
            return redirect("maintain_splits")
    return form_page(request, "maintain/announcement.html", form)
