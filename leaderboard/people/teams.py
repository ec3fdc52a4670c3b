"""Teams: a person is in one at a time; a person alone is a team of one.

Changes of members lock, in this order: the person, the teams by their ids, the invitation.
"""

import secrets
from datetime import datetime

from django.db import IntegrityError, transaction
from django.db.models import Q
from django.db.models.functions import Now

from leaderboard import audit, board_versions
from leaderboard.errors.refusals import Refused, require_maintainer
from leaderboard.models import Invitation, Membership, Method, QuotaOverride, Team, User
from leaderboard.people import accounts
from leaderboard.people.names import MAX_NAME, clean_name, numbered, require_rename_possible, skeleton


def current_team_of(*, user: User) -> Team | None:
    return Team.objects.filter(memberships__user=user).first()


def team_of(*, user: User) -> Team:
    """Return the person's team; make a team of one for a person without."""
    present = current_team_of(user=user)
    if present is not None:
        return present
    try:
        # An address is nobody's business, nor is how many have signed up: the name reveals neither.
        wanted = clean_name("name", user.name)
    except Refused:
        wanted = f"Team {secrets.token_hex(3)}"
    name = numbered(wanted[:MAX_NAME], is_taken=_public_twin)
    return _created(Team.objects.create(name=name, look=skeleton(name)), user)


def create(*, user: User, name: str, now: datetime) -> Team:
    """Found a team with a name. Raises `Refused`."""
    name = clean_name("name", name)
    with transaction.atomic():
        accounts.hold_open(user)
        if current_team_of(user=user) is not None:
            raise Refused("in-a-team", "You are in a team already; expected somebody who is in none.")
        if _public_twin(name):
            raise _taken(name)
        return _created(Team.objects.create(name=name, look=skeleton(name), created_at=now), user)


def rename(*, team: Team, name: str, actor: User, now: datetime) -> Team:
    """Rename the team, as its owner, at most once a day. Raises `Refused`."""
    name = clean_name("name", name)
    with transaction.atomic():
        row = locked_team(team)
        require_owner(row, actor, doing="renames it")
        if row.name == name:
            return row
        require_rename_possible(renamed_at=row.renamed_at, now=now)
        before = row.name
        set_name(team=row, name=name, now=now)
        audit.record_of(row, "renamed", actor=actor, names={"from": before, "to": name})
        board_versions.bump_for_methods(Method.objects.filter(team=row).shown().values_list("pk", flat=True))
    return row


def set_name(*, team: Team, name: str, now: datetime) -> None:
    """Name a team that the caller has locked. Raises `Refused` for a taken name."""
    if _public_twin(name, but=team):
        raise _taken(name)
    team.name, team.look, team.renamed_at = name, skeleton(name), now
    try:
        with transaction.atomic():
            team.save(update_fields=["name", "look", "renamed_at"])
    except IntegrityError:
        raise _taken(name) from None


def show_name(team: Team) -> None:
    """Mark the locked team's name as public. Raises `Refused` where it is taken."""
    if team.is_shown:
        return
    require_showable(team)
    try:
        with transaction.atomic():
            Team.objects.filter(pk=team.pk).update(is_shown=True)
    except IntegrityError:
        raise _taken_first(team.name) from None


def show_name_in_any_case(team: Team) -> None:
    """Mark the name as public, with a number added if it is taken."""
    name = numbered(team.name, is_taken=lambda name: _public_twin(name, but=team))
    if name != team.name:
        Team.objects.filter(pk=team.pk).update(name=name, look=skeleton(name))
    before, team.name = team.name, name
    show_name(team)
    if name != before:
        details = {"reason": "another team used this name on the boards first"}
        names = {"from": before, "to": name}
        audit.record_of(team, "renamed", details=details, names=names)


def require_showable(team: Team) -> None:
    """Raise `Refused` where another team on the boards has a similar name."""
    if not team.is_shown and _public_twin(team.name, but=team):
        raise _taken_first(team.name)


def leave(*, user: User) -> Team:
    """Leave one's team. Returns it. Raises `Refused`."""
    with transaction.atomic():
        membership = current_membership(user)
        if membership is None:
            raise Refused("in-no-team", "You are in no team; expected a member of one.")
        team = membership.team
        others = team.memberships.exclude(user=user)
        if membership.is_owner and others.exists():
            raise Refused(
                "hand-over-first",
                f"You own the team {team.name!r}, which has other members; make one of them its owner first.",
            )
        membership.delete()
        end_invitations(team, of=user)
        is_gone = end_if_empty(team)
        audit.record_of(team, "left", actor=user, details={"team_ended": is_gone})
    return team


def remove(*, team: Team, member: User, actor: User) -> None:
    """Remove a member, as the owner. Raises `Refused`."""
    with transaction.atomic():
        row = locked_team(team)
        require_owner(row, actor, doing="removes members")
        if member == actor:
            raise Refused("not-yourself", "You cannot remove yourself; expected another member of your team.")
        _membership_in(row, member).delete()
        end_invitations(row, of=member)
        audit.record_of(row, "removed_member", actor=actor, details={"user": member.pk})


def hand_over(*, team: Team, to: User, actor: User) -> None:
    """Make another member the owner. Raises `Refused`."""
    with transaction.atomic():
        row = locked_team(team)
        require_owner(row, actor, doing="hands it over")
        if to == actor:
            raise Refused("not-yourself", "You own the team already; expected another member.")
        heir = _membership_in(row, to)
        Membership.objects.filter(team=row, user=actor).update(is_owner=False)
        Membership.objects.filter(pk=heir.pk).update(is_owner=True)
        audit.record_of(row, "handed_over", actor=actor, details={"user": to.pk})


def appoint(*, team: Team, to: User, reason: str, actor: User | None) -> None:
    """Make a member the owner, as a maintainer. Raises `NotMaintainer` and `Refused`."""
    require_maintainer(actor, to="appoint owners of teams")
    with transaction.atomic():
        row = locked_team(team)
        heir = _membership_in(row, to)
        before = list(row.memberships.filter(is_owner=True).values_list("user", flat=True))
        row.memberships.exclude(pk=heir.pk).update(is_owner=False)
        row.memberships.filter(pk=heir.pk).update(is_owner=True)
        details = {"user": to.pk, "from": before, "reason": reason}
        audit.record_of(row, "appointed_owner", actor=actor, details=details)


# --- what several of these need --------------------------------------------------------------------------


def require_owner(team: Team, actor: User, *, doing: str) -> None:
    """Raise `Refused` for anybody but the team's owner."""
    if not team.memberships.filter(user=actor, is_owner=True).exists():
        raise Refused("not-the-owner", f"Only the owner of a team {doing}.")


def require_member(team: Team, user: User) -> None:
    """Raise `Refused` for a user who is not in the team."""
    if not team.memberships.filter(user=user).exists():
        raise Refused("not-your-team", f"You are not in the team {team.name!r} any more; try again.")


def locked(*teams: Team | None) -> list[Team]:
    """Lock and return these teams, in the order of their ids."""
    ids = [team.pk for team in teams if team is not None]
    return list(Team.objects.select_for_update(no_key=True).filter(pk__in=ids).order_by("pk"))


def locked_team(team: Team) -> Team:
    """Lock and return the team. Raises `Refused` if it was deleted."""
    rows = locked(team)
    if not rows:
        raise Refused("changed-meanwhile", f"The team {team.name!r} was just deleted; reload the page.")
    return rows[0]


def current_membership(user: User, *also: Team) -> Membership | None:
    """Return the person's membership, its team and these others locked. Raises `Refused` if it changed."""
    accounts.hold(user)
    seen = Membership.objects.filter(user=user).select_related("team").first()
    locked(*also, seen.team if seen else None)
    membership = Membership.objects.filter(user=user).select_related("team").first()
    if (membership and membership.team_id) != (seen and seen.team_id):
        raise Refused("changed-meanwhile", "Your team has just changed; reload the page and try again.")
    return membership


def end_if_empty(team: Team) -> bool:
    """Delete a team without members, methods and quota overrides. Returns whether it is gone."""
    rests = (
        team.memberships.exists()
        or Method.objects.filter(team=team).exists()
        or QuotaOverride.objects.filter(team=team).exists()
    )
    if not rests:
        Team.objects.filter(pk=team.pk).delete()
    return not rests


def end_invitations(team: Team, *, of: User) -> None:
    """Revoke the invitations of a former member."""
    links = Invitation.objects.filter(team=team, created_by=of, accepted_at=None, revoked_at=None)
    links.update(revoked_at=Now())


def _membership_in(team: Team, user: User) -> Membership:
    membership = team.memberships.filter(user=user).first()
    if membership is None:
        raise Refused(
            "not-a-member", f"That person is not in the team {team.name!r}; expected one of its members."
        )
    return membership


def _taken(name: str) -> Refused:
    return Refused(
        "name-taken", f"There is a team whose name looks like {name!r}; expected another one.", field="name"
    )


def _taken_first(name: str) -> Refused:
    return Refused(
        "name-taken",
        f"There is a team on the boards whose name looks like {name!r}, which was public first; rename "
        "your team before you publish.",
        field="visibility",
    )


def _public_twin(name: str, *, but: Team | None = None) -> bool:
    # Only public teams take a name. One from before looks were compared has its number after its look.
    look = skeleton(name)
    shown = Team.objects.filter(Q(look=look) | Q(look__startswith=f"{look} "), is_shown=True)
    return (shown.exclude(pk=but.pk) if but is not None else shown).exists()


def _created(team: Team, user: User) -> Team:
    # Another request of the same person may have made the team first.
    try:
        with transaction.atomic():
            Membership.objects.create(team=team, user=user, is_owner=True)
            audit.record_of(team, "created", actor=user)
    except IntegrityError:
        team.delete()
        return team_of(user=user)
    return team
