"""The page on which a person chooses which mails to get."""

from typing import Final, cast

from django import forms
from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods

from leaderboard.mails import notices
from leaderboard.models import MailKind, User
from leaderboard.web.forms import SiteForm

_CHOICES: Final = [(kind.value, kind.label) for kind in MailKind if kind is not MailKind.ACCOUNT]


class MailsForm(SiteForm):
    """A tick for each kind of mail that is wanted."""

    wanted = forms.MultipleChoiceField(label="Send me a mail about", choices=_CHOICES, required=False)


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def mails(request: HttpRequest) -> HttpResponse:
    """Choose the kinds of mail."""
    user = cast("User", request.user)
    wanted = [kind for kind, _ in _CHOICES if kind not in notices.muted_by(user)]
    form = MailsForm.asked(request, initial={"wanted": wanted})
    if form.is_valid():
        notices.choose(user=user, wanted=form.cleaned_data["wanted"])
        messages.success(request, "Your choice is saved.")
        return redirect("mails")
    return render(request, "account/mails.html", {"form": form}, status=422 if form.errors else 200)
