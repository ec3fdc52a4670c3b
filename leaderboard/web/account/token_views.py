"""The page of a person's API tokens."""

from typing import cast

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_POST

from leaderboard import tokens as verbs
from leaderboard.models import ApiToken, User
from leaderboard.web.token_forms import TokenForm, token_rows


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def tokens(request: HttpRequest) -> HttpResponse:
    """List and make tokens. A new one stands in the answer to its form, and never again."""
    user = cast("User", request.user)
    now = timezone.now()
    form = TokenForm(request.POST if request.method == "POST" else None)
    secret = ""
    if form.is_valid():
        try:
            secret = verbs.create(user=user, now=now, **form.token())
            form = TokenForm()
        except verbs.Refused as refusal:
            form.refuse(refusal)
    context = {"form": form, "secret": secret, "rows": token_rows(user, now=now)}
    return render(request, "tokens.html", context, status=422 if form.errors else 200)


@login_required
@never_cache
@require_POST
def revoke(request: HttpRequest) -> HttpResponse:
    """End one's own token at once."""
    user = cast("User", request.user)
    row = get_object_or_404(ApiToken, user=user, digest=request.POST.get("token", "").replace("\x00", ""))
    verbs.revoke(token=row, now=timezone.now(), actor=user)
    messages.success(request, f"The token {row.name} is revoked: it opens nothing any more.")
    return redirect("tokens")
