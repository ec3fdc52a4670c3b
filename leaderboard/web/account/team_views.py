"""The pages of a team: its name, its members, its invitations."""

from collections.abc import Callable
from datetime import datetime
from typing import Any, cast
from uuid import UUID

from allauth.account.decorators import reauthentication_required
from django import forms
from django.contrib import messages
from django.contrib.auth.views import redirect_to_login
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.debug import sensitive_variables

from leaderboard.errors.refusals import Refused
from leaderboard.models import Invitation, Team, User
from leaderboard.people import invitations, names, teams
from leaderboard.web.account import shown_once
from leaderboard.web.decorators import asks_first, own_action, own_form
from leaderboard.web.forms import SiteForm


class SignupNameForm(forms.Form):
    name = forms.CharField(
        label="Name on the board (optional)",
        max_length=80,
        required=False,
        help_text="Your own name or your team’s. Without one, boards show “Team” and a number.",
        widget=forms.TextInput(attrs={"autocomplete": "nickname"}),
    )
    field_order = ["email", "name", "password1", "password2"]

    def clean_name(self) -> str:
        # Two teams whose names look alike get a number.
        name: str = self.cleaned_data["name"]
        if not name.strip():
            return ""
        try:
            return names.clean_name("name", name)
        except Refused as refusal:
            raise forms.ValidationError(str(refusal)) from None

    def signup(self, request: HttpRequest, user: User) -> None:
        user.name = self.cleaned_data["name"]
        user.save(update_fields=["name"])


class NameForm(SiteForm):
    name = forms.CharField(
        help_text="Shown on the boards once your team has a public method. It must differ "
        "clearly from the names of other teams there. You can change the name once a day.",
        widget=forms.TextInput(attrs={"maxlength": 80, "autocomplete": "organization"}),
        error_messages={"required": "The team has no name; expected one."},
    )


def _team_page(user: User, *, now: datetime) -> dict[str, Any]:
    # Only the owner sees invitations.
    team = teams.current_team_of(user=user)
    members = team.memberships.select_related("user").order_by("-is_owner", "joined_at", "pk") if team else ()
    is_owner = any(member.is_owner and member.user_id == user.pk for member in members)
    is_alone = len(members) <= 1
    rows = team.invitations.select_related("created_by", "accepted_by") if team and is_owner else ()
    return {
        "team": team,
        "members": members,
        "is_owner": is_owner,
        "is_alone": is_alone,
        "can_change_members": is_owner and not is_alone,
        # Each with its state, and without its secret.
        "invitations": [(row, invitations.state_of(row, now=now)) for row in rows],
        # Methods would be left to nobody if this person left.
        "would_be_lost": is_alone and team and team.methods.filter(deleted_at=None).exists(),
    }


def _own_team(request: HttpRequest) -> Team:
    return get_object_or_404(Team, memberships__user=cast("User", request.user))


def _member(request: HttpRequest, handle: UUID) -> tuple[Team, User]:
    own = _own_team(request)
    return own, get_object_or_404(User, membership__team=own, membership__handle=handle)


def _page(request: HttpRequest, *, status: int = 200, **context: Any) -> HttpResponse:
    user = cast("User", request.user)
    page = _team_page(user, now=timezone.now())
    form = NameForm(initial={"name": page["team"].name if page["team"] else user.name})
    context = {"page": page, "form": form, **context}
    return shown_once.render_with(request, "account/team.html", context, at="team", status=status)


def _done(request: HttpRequest, action: Callable[[], object], *, flash_message: str) -> HttpResponse:
    try:
        action()
    except Refused as refusal:
        return _page(request, refusal=str(refusal), status=422)
    messages.success(request, flash_message)
    return redirect("team")


# Whoever finds an open session must not give away the team, or the way to its methods, for good.
_confirmed = reauthentication_required(_done)


@own_form
def team(request: HttpRequest) -> HttpResponse:
    """Show members and invitations; a posted name founds or renames the team."""
    if request.method != "POST":
        return _page(request)
    user = cast("User", request.user)
    form = NameForm(request.POST)
    if form.is_valid():
        with form.refusals():
            own, name = teams.current_team_of(user=user), form.cleaned_data["name"]
            if own is None:
                teams.create(user=user, name=name, now=timezone.now())
            else:
                teams.rename(team=own, name=name, actor=user, now=timezone.now())
            messages.success(request, f"The team {'is now called' if own else 'is created:'} {name}.")
            return redirect("team")
    return _page(request, form=form, status=422)


@own_action
@sensitive_variables("secret")
def invite(request: HttpRequest) -> HttpResponse:
    own, now = _own_team(request), timezone.now()
    try:
        _, secret = invitations.make(team=own, actor=cast("User", request.user), now=now)
    except Refused as refusal:
        return _page(request, refusal=str(refusal), status=422)
    return shown_once.redirect_with(invitations.link(secret), request=request, to="team")


@own_action
def revoke_invitation(request: HttpRequest, invitation_id: UUID) -> HttpResponse:
    invitation = get_object_or_404(Invitation, team=_own_team(request), pk=invitation_id)
    user = cast("User", request.user)
    return _done(
        request,
        lambda: invitations.revoke(invitation=invitation, actor=user, now=timezone.now()),
        flash_message="The invitation is revoked.",
    )


@own_action
def leave(request: HttpRequest) -> HttpResponse:
    """Leave one's team; the last member of a team with methods has to confirm it."""
    _own_team(request)
    user = cast("User", request.user)
    is_lost = _team_page(user, now=timezone.now())["would_be_lost"]
    if is_lost and not request.POST.get("confirm"):
        sentence = "Confirm that the private methods become inaccessible; expected a tick."
        return _page(request, refusal=sentence, status=422)
    done = _confirmed if is_lost else _done
    return done(request, lambda: teams.leave(user=user), flash_message="You left the team.")


@own_action
def remove(request: HttpRequest, handle: UUID) -> HttpResponse:
    own, member = _member(request, handle)
    return _done(
        request,
        lambda: teams.remove(team=own, member=member, actor=cast("User", request.user)),
        flash_message=f"{member.email} is no longer in the team.",
    )


@own_action
def hand_over(request: HttpRequest, handle: UUID) -> HttpResponse:
    own, member = _member(request, handle)
    user = cast("User", request.user)
    try:
        teams.require_owner(own, user, doing="hands it over")
    except Refused as refusal:
        return _page(request, refusal=str(refusal), status=422)
    return _confirmed(
        request,
        lambda: teams.hand_over(team=own, to=member, actor=user),
        flash_message=f"{member.email} owns the team now.",
    )


@never_cache
@sensitive_variables("secret")
@asks_first
def join(request: HttpRequest, secret: str) -> HttpResponse:
    """Show the meaning of an invitation, and join; a visitor sees the inviter."""
    user, now = cast("User", request.user), timezone.now()
    try:
        invitation = invitations.find(secret=secret, now=now)
        if invitation is None:
            raise Http404
        if not user.is_authenticated:
            if request.method == "POST":
                return redirect_to_login(request.get_full_path())
            return render(request, "account/invited.html", {"invitation": invitation})
        if request.method == "POST":
            own = invitations.accept(secret=secret, user=user, now=now)
            messages.success(request, f"You are now in the team {own.name}.")
            return redirect("team")
    except invitations.UnusableInvitation as refusal:
        return render(request, "account/unusable.html", {"sentence": str(refusal)}, status=410)
    except Refused as refusal:
        return _page(request, refusal=str(refusal), status=422)
    return render(
        request, "account/join.html", {"meaning": invitations.meaning(invitation=invitation, user=user)}
    )
