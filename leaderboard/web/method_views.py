"""The pages of one's own methods: what is said of them, and who sees them."""

from typing import cast
from uuid import UUID

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods

from leaderboard import methods
from leaderboard import visibility as verbs
from leaderboard.models import Method, User
from leaderboard.texts import Refused
from leaderboard.web import method_tables
from leaderboard.web.method_forms import MethodForm, ShowForm


def _own(request: HttpRequest, method_id: UUID) -> Method:
    """One of the reader's own team's methods; any other is not there."""
    return get_object_or_404(Method.objects.of(request.user).select_related("team"), pk=method_id)


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def edit(request: HttpRequest, method_id: UUID) -> HttpResponse:
    """Say something else of a method."""
    found = _own(request, method_id)
    form = MethodForm.asked(request, method=found)
    if form.is_valid():
        try:
            methods.edit(method=found, changes=form.changes(), actor=cast("User", request.user))
            return redirect("method", found.pk)
        except Refused as refusal:
            form.refuse(refusal)
    return render(
        request, "methods/edit.html", {"method": found, "form": form}, status=422 if form.errors else 200
    )


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def visibility(request: HttpRequest, method_id: UUID) -> HttpResponse:
    """Choose who sees a method, look at what they would see, and show it."""
    found = _own(request, method_id)
    now = timezone.now()
    form = ShowForm.asked(request, method=found)
    preview = None
    if form.is_bound:
        try:
            wanted = form.wanted(now=now)
            verbs.require_possible(found, now=now, **wanted)
            preview = verbs.preview(method=found, visibility=wanted["visibility"], now=now)
            if request.method == "POST":
                form.require_confirmation()
                verbs.change(method=found, actor=cast("User", request.user), now=now, **wanted)
                messages.success(request, method_tables.shown_sentence(found.pk))
                return redirect("method", found.pk)
        except Refused as refusal:
            form.refuse(refusal)
    context = {"method": found, "form": form, "preview": method_tables.preview_table(preview)}
    return render(request, "methods/visibility.html", context, status=422 if form.errors else 200)
