"""The page of a person's API tokens."""

from typing import cast

from allauth.account.decorators import reauthentication_required
from django import forms
from django.contrib import messages
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect
from django.utils import timezone
from django.views.decorators.debug import sensitive_variables

from leaderboard.models import ApiToken, Scope, Split, User
from leaderboard.people import tokens
from leaderboard.web.account import shown_once
from leaderboard.web.decorators import own_action, own_form
from leaderboard.web.forms import SiteForm


def _splits() -> list[tuple[str, str]]:
    names = Split.objects.shown().values_list("pk", flat=True)
    return [("", "all"), *((name, name) for name in names)]


class TokenForm(SiteForm):
    name = forms.CharField(
        help_text="What it is for, such as “nightly CI”.",
        widget=forms.TextInput(attrs={"maxlength": 80, "autocomplete": "off"}),
        error_messages={"required": "The token has no name; expected what it is for."},
    )
    scopes = forms.MultipleChoiceField(
        label="Scope",
        widget=forms.CheckboxSelectMultiple,
        choices=[
            (Scope.READ, "read: see submissions and results"),
            (Scope.SUBMIT, "submit: send and withdraw files, edit methods"),
            (Scope.PUBLISH, "publish: publish methods, which cannot be undone"),
        ],
        initial=list(tokens.USUAL_SCOPES),
        error_messages={"required": "The token has no scope; expected read, submit or publish."},
    )
    split = forms.ChoiceField(label="Split", required=False, choices=_splits)
    days = forms.IntegerField(
        label="Expires in (days)",
        initial=tokens.DAYS,
        help_text=f"At most {tokens.MAX_DAYS}.",
        widget=forms.NumberInput(attrs={"min": 1, "max": tokens.MAX_DAYS}),
        error_messages={
            "required": f"No number of days was given; expected 1 to {tokens.MAX_DAYS}.",
            "invalid": f"That is not a whole number of days; expected 1 to {tokens.MAX_DAYS}.",
        },
    )


@own_form
def token_page(request: HttpRequest) -> HttpResponse:
    """List and make tokens; a new one is shown once, on the next page."""
    user = cast("User", request.user)
    now = timezone.now()
    form = TokenForm.asked(request)
    if form.is_valid():
        with form.refusals():
            return _create(request, form)
    # Those that have ended stay, to tell what an old job used.
    own = ApiToken.objects.filter(user=user).order_by("-created")
    rows = [(token, tokens.state_of(token, now=now)) for token in own]
    context = {"form": form, "rows": rows}
    status = 422 if form.errors else 200
    return shown_once.render_with(request, "account/tokens.html", context, at="tokens", status=status)


@reauthentication_required
@sensitive_variables("secret")
def _create(request: HttpRequest, form: TokenForm) -> HttpResponse:
    # A token outlives the session, which may be one that was found open.
    limits = {name: form.cleaned_data[name] for name in ("name", "scopes", "days")}
    secret = tokens.create(
        user=cast("User", request.user),
        now=timezone.now(),
        split_name=form.cleaned_data["split"],
        **limits,
    )
    return shown_once.redirect_with(secret, request=request, to="tokens")


@own_action
def revoke(request: HttpRequest) -> HttpResponse:
    user = cast("User", request.user)
    row = get_object_or_404(ApiToken, user=user, digest=request.POST.get("token", "").replace("\x00", ""))
    tokens.revoke(token=row, now=timezone.now(), actor=user)
    messages.success(request, f"The token {row.name} is revoked.")
    return redirect("tokens")
