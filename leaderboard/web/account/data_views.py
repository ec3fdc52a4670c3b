"""A person's data: download, deletion, and the mails that they get."""

from typing import Final, cast

from allauth.account.decorators import reauthentication_required
from django import forms
from django.contrib import messages
from django.contrib.auth import logout
from django.http import HttpRequest, HttpResponse, JsonResponse
from django.shortcuts import redirect, render
from django.utils import timezone

from leaderboard.errors.refusals import Refused
from leaderboard.mails import notices
from leaderboard.models import MailKind, User
from leaderboard.moderation import forgetting
from leaderboard.people import addresses, teams
from leaderboard.quotas import mailboxes
from leaderboard.quotas.spans import span
from leaderboard.web.decorators import own_form, own_page
from leaderboard.web.forms import SiteForm


class DeleteForm(SiteForm):
    # The address once more, so that nobody deletes the account by accident.
    email = forms.CharField(
        label="Email address of this account",
        max_length=254,
        help_text="Type it to confirm.",
        error_messages={"required": "No address was typed; expected the address of this account."},
        widget=forms.EmailInput(attrs={"autocomplete": "off"}),
    )

    def require(self, user: User) -> None:
        if addresses.stored(self.cleaned_data["email"]) != user.email:
            raise Refused(
                "bad-value", "That is another address; expected the address of this account.", field="email"
            )


@own_form
def data(request: HttpRequest) -> HttpResponse:
    user = cast("User", request.user)
    form = DeleteForm.asked(request)
    if form.is_valid():
        with form.refusals():
            form.require(user)
            return _forget(request)
    stays = span(mailboxes.longest_window()) if addresses.are_proved() else ""
    team = teams.current_team_of(user=user)
    n_members = team.memberships.count() if team else 0
    context = {"form": form, "quota_stays": stays, "n_members": n_members}
    return render(request, "account/data.html", context, status=422 if form.errors else 200)


@reauthentication_required
def _forget(request: HttpRequest) -> HttpResponse:
    # An open session is not enough: the person must confirm their identity.
    user = cast("User", request.user)
    forgetting.forget(user=user, reason="on their own page", actor=user, now=timezone.now())
    logout(request)
    messages.success(request, "Your account is deleted.")
    return redirect("home")


@own_page
def download(request: HttpRequest) -> HttpResponse:
    return JsonResponse(
        forgetting.export(user=cast("User", request.user)),
        json_dumps_params={"indent": 1, "ensure_ascii": False},
        headers={"Content-Disposition": 'attachment; filename="tsttc-my-data.json"'},
    )


_CHOICES: Final = [(kind.value, kind.label) for kind in MailKind if kind is not MailKind.ACCOUNT]


class MailsForm(SiteForm):
    wanted = forms.MultipleChoiceField(
        label="Email me when", choices=_CHOICES, required=False, widget=forms.CheckboxSelectMultiple
    )


@own_form
def mails(request: HttpRequest) -> HttpResponse:
    user = cast("User", request.user)
    wanted = [kind for kind, _ in _CHOICES if kind not in notices.muted_by(user)]
    form = MailsForm.asked(request, initial={"wanted": wanted})
    if form.is_valid():
        notices.choose(user=user, wanted=form.cleaned_data["wanted"])
        messages.success(request, "Your choice is saved.")
        return redirect("mails")
    return render(request, "account/mails.html", {"form": form}, status=422 if form.errors else 200)
