"""Pages of a method: results for everybody; details and visibility for its team."""

from collections.abc import Sequence
from typing import Any, cast
from uuid import UUID

from django.conf import settings
from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.urls import reverse
from django.utils import timezone
from django.views.decorators.http import require_safe

from leaderboard.boards import results, visibility_preview
from leaderboard.boards.results import Result
from leaderboard.boards.rows import Profile
from leaderboard.boards.snapshots import splits_of
from leaderboard.http_caching import cacheable
from leaderboard.methods import details, editing, visibility
from leaderboard.models import Method, Status, Submission, User, Visibility
from leaderboard.moderation import empty_methods
from leaderboard.statistics import comparisons
from leaderboard.submissions import search
from leaderboard.web.boards import export_views
from leaderboard.web.decorators import own_form
from leaderboard.web.forms import ConfirmForm
from leaderboard.web.methods import visibility_words
from leaderboard.web.methods.method_forms import MethodForm, ShowForm
from leaderboard.web.methods.result_tables import edition_table, method_result, submission_table

N_LAST = 10


@require_safe
def method(request: HttpRequest, method_id: UUID) -> HttpResponse:
    rows = Method.objects.visible_to(request.user).select_related("team")
    row = get_object_or_404(rows, pk=method_id)
    achieved = results.results(method=row, viewer=request.user, splits=splits_of(request))
    profile = results.profile(method=row, viewer=request.user)
    is_mine = Method.objects.of(request.user).filter(pk=row.pk).exists()
    last = []
    if is_mine and not achieved:
        sent = search.of_teams(cast("User", request.user)).filter(method=row)
        last = list(sent.order_by("-submitted_at")[:N_LAST])
    sent_to = last[0].split if last else None
    is_named = row.is_named_for(request.user)
    exports = export_views.of_method(achieved, visited_on=timezone.now().date())
    pairs = [comparisons.against(result.entry, result.rivals, edition=result.edition) for result in achieved]
    context = {
        "profile": profile,
        "description": f"{profile.name} by {profile.team} on the {settings.BENCHMARK.site_name}.",
        "contents": _contents(profile, achieved),
        "chips": details.chips(profile.details),
        "visibility": row.visibility,
        "section": "submissions" if is_mine and row.visibility == Visibility.PRIVATE else "board",
        "has_badge": row.visibility == Visibility.PRIVATE
        or (row.visibility == Visibility.ANONYMOUS and is_named),
        "seen_by": visibility_words.seen_by(row.visibility, is_named=is_named, is_mine=is_mine),
        "is_named": is_named,
        "is_mine": is_mine,
        # A private method without a result has nothing to show yet.
        "can_be_shown": row.visibility == Visibility.ANONYMOUS
        or (row.visibility == Visibility.PRIVATE and bool(achieved)),
        "can_be_deleted": is_mine and empty_methods.can_be_deleted(row),
        "method_id": row.pk,
        "results": [
            method_result(result, of_result) for result, of_result in zip(achieved, pairs, strict=True)
        ],
        "table": submission_table(last),
        "board_split": achieved[0].split.pk if achieved else sent_to.pk if sent_to else "",
        **exports,
        **_badge(row, split=exports.get("badge_split", "")),
    }
    # What is being computed changes by itself.
    is_complete = all(pair.differences is not None for of_result in pairs for pair in of_result)
    return (cacheable(_drawn) if is_complete else _drawn)(request, context)


def _drawn(request: HttpRequest, context: dict[str, Any]) -> HttpResponse:
    return render(request, "methods/method.html", context)


def _contents(profile: Profile, achieved: Sequence[Result]) -> str:
    """Say who made a method and its ranks, for who shares its address."""
    ranks = [
        f" Rank {each.entry.rank} of {each.n_ranked} on {each.split.title}."
        for each in achieved
        if each.entry.rank
    ]
    return f"By {profile.team}.{''.join(ranks)}"


def _badge(method: Method, *, split: str) -> dict[str, str]:
    """Return the address of a method's badge, and the Markdown that shows it and leads to the method."""
    path = reverse("badge", args=[method.pk]) + (f"?split={split}" if split else "")
    page = settings.SITE_URL + reverse("method", args=[method.pk])
    return {
        "badge_path": path,
        "badge_markdown": f"[![{settings.BENCHMARK.name}]({settings.SITE_URL}{path})]({page})",
    }


def _own(request: HttpRequest, method_id: UUID) -> Method:
    return get_object_or_404(Method.objects.of(request.user).select_related("team"), pk=method_id)


@own_form
def edit(request: HttpRequest, method_id: UUID) -> HttpResponse:
    own = _own(request, method_id)
    form = MethodForm.of_method(request, method=own)
    if form.is_valid():
        with form.refusals():
            editing.edit(method=own, changes=form.changes(), actor=cast("User", request.user))
            messages.success(request, "The details are saved.")
            return redirect("method", own.pk)
    return render(
        request, "methods/edit.html", {"method": own, "form": form}, status=422 if form.errors else 200
    )


@own_form
def delete(request: HttpRequest, method_id: UUID) -> HttpResponse:
    """Delete an empty method after a page that explains it; for any other say why it stays."""
    own = _own(request, method_id)
    form = ConfirmForm.asked(request)
    if form.is_valid():
        with form.refusals():
            empty_methods.delete(method=own, actor=cast("User", request.user), now=timezone.now())
            messages.success(request, f"{own.name} is deleted.")
            return redirect("submissions")
    kept_by = empty_methods.evaluations_that_keep(own)
    is_empty = empty_methods.can_be_deleted(own)
    context = {
        "method": own,
        "heading": f"Delete “{own.name}”" if is_empty else f"“{own.name}” cannot be deleted",
        "form": form,
        "is_empty": is_empty,
        "n_scored": kept_by.filter(status=Status.SCORED).values("submission").distinct().count(),
        "undecided": Submission.objects.filter(evaluations__in=kept_by).distinct().order_by("submitted_at"),
    }
    return render(request, "methods/delete.html", context, status=422 if form.errors else 200)


@own_form
def change_visibility(request: HttpRequest, method_id: UUID) -> HttpResponse:
    """Choose a visibility, preview it, and publish."""
    own = _own(request, method_id)
    now = timezone.now()
    form = ShowForm.of_method(request, method=own)
    preview = None
    if form.is_valid():
        with form.refusals():
            wanted = form.wanted()
            visibility.require_possible(own, now=now, **wanted)
            preview = visibility_preview.preview(method=own, visibility=wanted["visibility"], now=now)
            if request.method == "POST" and not form.cleaned_data["confirm"]:
                form.add_error("confirm", "Confirm that this cannot be undone: tick the box.")
            elif own.visibility == "ANONYMOUS" and request.POST.get("previous") == "PRIVATE":
                form.add_error("confirm", "The method has become anonymous meanwhile: read this page again.")
            elif request.method == "POST":
                visibility.change(method=own, actor=cast("User", request.user), now=now, **wanted)
                messages.success(request, _published_sentence(own.pk))
                return redirect("method", own.pk)
    context = {"method": own, "form": form, "words": visibility_words.words(own)}
    if preview is not None:
        context["preview"] = preview
        context["preview_label"] = Visibility(preview.visibility).label
        context["details"] = details.words(preview.profile.details)
        context["button"] = visibility_words.button(own.visibility, wanted=preview.visibility)
        context["boards"] = [
            {
                "split": board.split,
                "standing": visibility_words.standing(board),
                "table": edition_table(board.entry, board.edition),
                "attempts": visibility_words.attempts(board, wanted=preview.visibility),
            }
            for board in preview.boards
        ]
    return render(request, "methods/visibility.html", context, status=422 if form.errors else 200)


def _published_sentence(method_id: UUID) -> str:
    method = Method.objects.get(pk=method_id)
    if method.visibility == Visibility.PUBLIC:
        return f"{method.name} is now public."
    until = f", until {method.reveal_at:%Y-%m-%d %H:%M} UTC" if method.reveal_at else ""
    return f"{method.name} is now visible to everyone as {method.pseudonym}{until}."
