"""The page of a person's API tokens."""

from typing import cast

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.debug import sensitive_variables
from django.views.decorators.http import require_http_methods, require_POST

from leaderboard.models import ApiToken, User
from leaderboard.people import tokens
from leaderboard.web.account import shown_once
from leaderboard.web.account.token_forms import TokenForm


@login_required
@never_cache
@sensitive_variables("secret")
@require_http_methods(["GET", "HEAD", "POST"])
def token_page(request: HttpRequest) -> HttpResponse:
    """List and make tokens. A new one is shown on the page after its form, and never again."""
    user = cast("User", request.user)
    now = timezone.now()
    form = TokenForm.asked(request)
    if form.is_valid():
        with form.refusals():
            secret = tokens.create(user=user, now=now, **form.token())
            return shown_once.redirect_with(secret, request=request, to="tokens")
    # Those that have ended stay, to tell what an old job used.
    own = ApiToken.objects.filter(user=user).order_by("-created")
    rows = [(token, tokens.state_of(token, now=now)) for token in own]
    context = {"form": form, "rows": rows}
    status = 422 if form.errors else 200
    return shown_once.render_with(request, "account/tokens.html", context, at="tokens", status=status)


@login_required
@never_cache
@require_POST
def revoke(request: HttpRequest) -> HttpResponse:
    """End one's own token at once."""
    user = cast("User", request.user)
    row = get_object_or_404(ApiToken, user=user, digest=request.POST.get("token", "").replace("\x00", ""))
    tokens.revoke(token=row, now=timezone.now(), actor=user)
    messages.success(request, f"The token {row.name} is revoked.")
    return redirect("tokens")
