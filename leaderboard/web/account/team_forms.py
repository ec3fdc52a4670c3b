"""What people say of their team, and what they see of it."""

from dataclasses import dataclass
from datetime import datetime

from django import forms

from leaderboard import invitations, teams
from leaderboard.models import Invitation, Membership, Team, User
from leaderboard.web.method_forms import RefusableForm


class NameForm(RefusableForm):
    """The team's name."""

    name = forms.CharField(
        help_text="As boards show it, once a method of yours is public. No two teams on the boards may have "
        "names that look alike. A name can be changed once a day.",
        widget=forms.TextInput(attrs={"maxlength": 80, "autocomplete": "organization"}),
        error_messages={"required": "The team has no name; expected one."},
    )


@dataclass(frozen=True)
class InvitationRow:
    """An invitation as the team sees it: without its secret, which nobody has but whoever got the link."""

    invitation: Invitation
    state: str


@dataclass(frozen=True)
class TeamPage:
    """Everything that the page of a team places."""

    team: Team | None
    members: tuple[Membership, ...]
    is_owner: bool
    is_alone: bool
    invitations: tuple[InvitationRow, ...]

    @property
    def would_be_lost(self) -> bool:
        """Whether methods would be left to nobody if this person left."""
        return self.is_alone and self.team is not None and self.team.methods.exists()


def team_page(user: User, *, now: datetime) -> TeamPage:
    """The person's team, as they see it. Invitations are the owner's to see."""
    team = teams.present_team_of(user=user)
    if team is None:
        return TeamPage(team=None, members=(), is_owner=False, is_alone=True, invitations=())
    members = tuple(team.memberships.select_related("user").order_by("-is_owner", "joined_at", "pk"))
    is_owner = any(member.is_owner and member.user_id == user.pk for member in members)
    rows = team.invitations.select_related("created_by", "accepted_by") if is_owner else ()
    return TeamPage(
        team=team,
        members=members,
        is_owner=is_owner,
        is_alone=len(members) == 1,
        invitations=tuple(InvitationRow(row, invitations.state_of(row, now=now)) for row in rows),
    )
