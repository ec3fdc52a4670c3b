"""Forms of a team, and the rows of its page."""

from dataclasses import dataclass
from datetime import datetime

from django import forms
from django.http import HttpRequest

from leaderboard.errors.refusals import Refused
from leaderboard.models import Invitation, Membership, Team, User
from leaderboard.people import invitations, names, teams
from leaderboard.web.forms import SiteForm


class SignupNameForm(forms.Form):
    """The name that signing up asks for, beside address and password."""

    name = forms.CharField(
        label="Name shown on the board",
        max_length=80,
        required=False,
        help_text="Your own name or your team's. Without one, boards show “Team” and a number. "
        "Your team and the maintainers see your email address.",
        widget=forms.TextInput(attrs={"autocomplete": "nickname"}),
    )
    field_order = ["email", "name", "password1", "password2"]

    def clean_name(self) -> str:
        """The name as boards will show it; two teams whose names look alike get a number."""
        name: str = self.cleaned_data["name"]
        if not name.strip():
            return ""
        try:
            return names.clean_name("name", name)
        except Refused as refusal:
            raise forms.ValidationError(str(refusal)) from None

    def signup(self, request: HttpRequest, user: User) -> None:
        """Called once the account exists."""
        user.name = self.cleaned_data["name"]
        user.save(update_fields=["name"])


class NameForm(SiteForm):
    """The team's name."""

    name = forms.CharField(
        help_text="Shown on the boards once your team has a public method. Names of teams on the boards "
        "must not look alike. You can change the name once a day.",
        widget=forms.TextInput(attrs={"maxlength": 80, "autocomplete": "organization"}),
        error_messages={"required": "The team has no name; expected one."},
    )


@dataclass(frozen=True)
class TeamPage:
    """Everything that the page of a team places."""

    team: Team | None
    members: tuple[Membership, ...]
    is_owner: bool
    is_alone: bool
    invitations: list[tuple[Invitation, str]]  # each with its state, and without its secret

    @property
    def would_be_lost(self) -> bool:
        """Whether methods would be left to nobody if this person left."""
        return self.is_alone and self.team is not None and self.team.methods.filter(deleted_at=None).exists()


def team_page(user: User, *, now: datetime) -> TeamPage:
    """The person's team, as they see it. Invitations are the owner's to see."""
    team = teams.current_team_of(user=user)
    if team is None:
        return TeamPage(team=None, members=(), is_owner=False, is_alone=True, invitations=[])
    members = tuple(team.memberships.select_related("user").order_by("-is_owner", "joined_at", "pk"))
    is_owner = any(member.is_owner and member.user_id == user.pk for member in members)
    rows = team.invitations.select_related("created_by", "accepted_by") if is_owner else ()
    return TeamPage(
        team=team,
        members=members,
        is_owner=is_owner,
        is_alone=len(members) == 1,
        invitations=[(row, invitations.state_of(row, now=now)) for row in rows],
    )
