"""The pages of a team: its name, its members, its invitations."""

from collections.abc import Callable
from typing import Any, cast
from uuid import UUID

from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.contrib.auth.views import redirect_to_login
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils import timezone
from django.views.decorators.cache import never_cache
from django.views.decorators.debug import sensitive_variables
from django.views.decorators.http import require_http_methods, require_POST

from leaderboard.errors.refusals import Refused
from leaderboard.models import Invitation, Team, User
from leaderboard.people import invitations, teams
from leaderboard.web.account import shown_once
from leaderboard.web.account.team_forms import NameForm, team_page


def _own_team(request: HttpRequest) -> Team:
    """The reader's team; somebody without one has none to act for."""
    return get_object_or_404(Team, memberships__user=cast("User", request.user))


def _member(request: HttpRequest, handle: UUID) -> tuple[Team, User]:
    """The reader's team and one of its members."""
    own = _own_team(request)
    return own, get_object_or_404(User, membership__team=own, membership__handle=handle)


def _page(request: HttpRequest, *, status: int = 200, **context: Any) -> HttpResponse:
    user = cast("User", request.user)
    page = team_page(user, now=timezone.now())
    form = NameForm(initial={"name": page.team.name if page.team else user.name})
    context = {"page": page, "form": form, **context}
    return shown_once.render_with(request, "account/team.html", context, at="team", status=status)


def _done(request: HttpRequest, deed: Callable[[], object], *, told: str) -> HttpResponse:
    """Do it and show the team and what was done, or show why not."""
    try:
        deed()
    except Refused as refusal:
        return _page(request, refusal=str(refusal), status=422)
    messages.success(request, told)
    return redirect("team")


@login_required
@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
def team(request: HttpRequest) -> HttpResponse:
    """Who is in it and who may come in. A name that is sent founds the team, or renames it."""
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


def _invited(request: HttpRequest, invitation: Invitation) -> HttpResponse:
    """Who invites, for somebody who is not signed in; then the way in leads back here."""
    if request.method == "POST":
        return redirect_to_login(request.get_full_path())
    return render(request, "account/invited.html", {"invitation": invitation})


@login_required
@never_cache
@sensitive_variables("secret")
@require_POST
def invite(request: HttpRequest) -> HttpResponse:
    """Make a link. It is shown on the page of the team that follows, and never again."""
    own, now = _own_team(request), timezone.now()
    try:
        _, secret = invitations.make(team=own, actor=cast("User", request.user), now=now)
    except Refused as refusal:
        return _page(request, refusal=str(refusal), status=422)
    return shown_once.redirect_with(invitations.link(secret), request=request, to="team")


@login_required
@never_cache
@require_POST
def revoke_invitation(request: HttpRequest, invitation_id: UUID) -> HttpResponse:
    """End a link that nobody has used."""
    found = get_object_or_404(Invitation, team=_own_team(request), pk=invitation_id)
    user = cast("User", request.user)
    return _done(
        request,
        lambda: invitations.revoke(invitation=found, actor=user, now=timezone.now()),
        told="The invitation is revoked.",
    )


@login_required
@never_cache
@require_POST
def leave(request: HttpRequest) -> HttpResponse:
    """Go out of one's team. Whoever would leave methods to nobody says that they know."""
    _own_team(request)
    user = cast("User", request.user)
    if team_page(user, now=timezone.now()).would_be_lost and not request.POST.get("confirm"):
        sentence = "Confirm that the private methods become inaccessible; expected a tick."
        return _page(request, refusal=sentence, status=422)
    return _done(request, lambda: teams.leave(user=user), told="You left the team.")


@login_required
@never_cache
@require_POST
def remove(request: HttpRequest, handle: UUID) -> HttpResponse:
    """Put a member out of the team."""
    own, member = _member(request, handle)
    return _done(
        request,
        lambda: teams.remove(team=own, member=member, actor=cast("User", request.user)),
        told=f"{member.email} is no longer in the team.",
    )


@login_required
@never_cache
@require_POST
def hand_over(request: HttpRequest, handle: UUID) -> HttpResponse:
    """Let another member own the team."""
    own, member = _member(request, handle)
    return _done(
        request,
        lambda: teams.hand_over(team=own, to=member, actor=cast("User", request.user)),
        told=f"{member.email} owns the team now.",
    )


@never_cache
@sensitive_variables("secret")
@require_http_methods(["GET", "HEAD", "POST"])
def join(request: HttpRequest, secret: str) -> HttpResponse:
    """Say who invites and what coming into the team means, and come in. A visitor is told who invites."""
    user, now = cast("User", request.user), timezone.now()
    try:
        found = invitations.find(secret=secret, now=now)
        if found is None:
            raise Http404
        if not user.is_authenticated:
            return _invited(request, found)
        if request.method == "POST":
            own = invitations.accept(secret=secret, user=user, now=now)
            messages.success(request, f"You are now in the team {own.name}.")
            return redirect("team")
    except invitations.UnusableInvitation as refusal:
        return render(request, "account/unusable.html", {"sentence": str(refusal)}, status=410)
    except Refused as refusal:
        return _page(request, refusal=str(refusal), status=422)
    return render(request, "account/join.html", {"meaning": invitations.meaning(invitation=found, user=user)})
