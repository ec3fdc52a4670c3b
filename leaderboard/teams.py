"""Teams: who competes. A person is in one team at a time; somebody alone is a team of one.

What changes who is in a team locks, in this order: the person, the teams by their ids, the invitation. A
submission locks its team as well, so nobody leaves while a slot of the quota is being counted.
"""

import secrets
from datetime import datetime

from django.db import IntegrityError, transaction
from django.db.models.functions import Now

from leaderboard import audit, boards
from leaderboard.models import Invitation, Membership, Method, QuotaOverride, Team, User
from leaderboard.names import MAX_NAME, clean_name, look
from leaderboard.texts import Refused

_ROOM_FOR_A_NUMBER = 10


def present_team_of(*, user: User) -> Team | None:
    """The person's team, if there is one yet."""
    return Team.objects.filter(memberships__user=user).first()


def team_of(*, user: User) -> Team:
    """The person's team; somebody without one becomes a team of one."""
    present = present_team_of(user=user)
    if present is not None:
        return present
    try:
        # An address is nobody's business, nor is how many have signed up: the name reveals neither.
        wanted = clean_name("name", user.name)
    except Refused:
        wanted = f"Team {secrets.token_hex(3)}"
    return _founded(_named(wanted), user)


def create(*, user: User, name: str, now: datetime) -> Team:
    """Found a team under a name of one's choice. Raises `Refused`."""
    name = clean_name("name", name)
    if present_team_of(user=user) is not None:
        raise Refused("in-a-team", "You are in a team already; expected somebody who is in none.")
    with transaction.atomic():
        try:
            with transaction.atomic():
                team = Team.objects.create(name=name, look=look(name), created_at=now)
        except IntegrityError:
            raise _taken(name) from None
        return _founded(team, user)


def rename(*, team: Team, name: str, actor: User) -> Team:
    """Call the team something else, on every board at once. Its owner does. Raises `Refused`."""
    name = clean_name("name", name)
    with transaction.atomic():
        row = locked(team)[0]
        require_owner(row, actor, doing="renames it")
        if row.name == name:
            return row
        before, row.name, row.look = row.name, name, look(name)
        try:
            with transaction.atomic():
                row.save(update_fields=["name", "look"])
        except IntegrityError:
            raise _taken(name) from None
        audit.record(
            verb="renamed", noun="Team", noun_id=row.pk, actor=actor, details={"from": before, "to": name}
        )
        boards.changed_by_methods(Method.objects.filter(team=row).shown().values_list("pk", flat=True))
    return row


def leave(*, user: User) -> Team:
    """Go out of one's team. What was sent from it stays with it. Returns the team that was left.

    An owner hands over first, unless nobody else is there. Raises `Refused`.
    """
    with transaction.atomic():
        membership = present_membership(user)
        if membership is None:
            raise Refused("in-no-team", "You are in no team; expected a member of one.")
        team = membership.team
        others = team.memberships.exclude(user=user)
        if membership.is_owner and others.exists():
            raise Refused(
                "hand-over-first",
                f"You own the team {team.name!r}, and others are in it; hand it over to one of them first.",
            )
        membership.delete()
        end_invitations(team, of=user)
        is_gone = end_if_empty(team)
        audit.record(verb="left", noun="Team", noun_id=team.pk, actor=user, details={"team_ended": is_gone})
    return team


def remove(*, team: Team, member: User, actor: User) -> None:
    """Put somebody out of the team. Its owner does, and leaves by leaving. Raises `Refused`."""
    with transaction.atomic():
        row = locked(team)[0]
        require_owner(row, actor, doing="removes members")
        if member == actor:
            raise Refused("not-yourself", "You would remove yourself; expected somebody else of your team.")
        _membership_in(row, member).delete()
        end_invitations(row, of=member)
        audit.record(
            verb="removed_member", noun="Team", noun_id=row.pk, actor=actor, details={"user": member.pk}
        )


def hand_over(*, team: Team, to: User, actor: User) -> None:
    """Let another member own the team. Raises `Refused`."""
    with transaction.atomic():
        row = locked(team)[0]
        require_owner(row, actor, doing="hands it over")
        if to == actor:
            raise Refused("not-yourself", "You own the team already; expected somebody else of it.")
        heir = _membership_in(row, to)
        Membership.objects.filter(team=row, user=actor).update(is_owner=False)
        Membership.objects.filter(pk=heir.pk).update(is_owner=True)
        audit.record(verb="handed_over", noun="Team", noun_id=row.pk, actor=actor, details={"user": to.pk})


def appoint(*, team: Team, to: User, reason: str, actor: User | None = None) -> None:
    """Make a member the owner, as a maintainer does where the owner is gone. Raises `Refused`."""
    with transaction.atomic():
        row = locked(team)[0]
        heir = _membership_in(row, to)
        before = list(row.memberships.filter(is_owner=True).values_list("user", flat=True))
        row.memberships.exclude(pk=heir.pk).update(is_owner=False)
        row.memberships.filter(pk=heir.pk).update(is_owner=True)
        details = {"user": to.pk, "from": before, "reason": reason}
        audit.record(verb="appointed_owner", noun="Team", noun_id=row.pk, actor=actor, details=details)


# --- what several of these need --------------------------------------------------------------------------


def require_owner(team: Team, actor: User, *, doing: str) -> None:
    """Raise `Refused` for anybody but the team's owner."""
    if not team.memberships.filter(user=actor, is_owner=True).exists():
        raise Refused("not-the-owner", f"Only the owner of a team {doing}.")


def require_member(team: Team, user: User) -> None:
    """Raise `Refused` for somebody who is not in the team, or not any more."""
    if not team.memberships.filter(user=user).exists():
        raise Refused("not-your-team", f"You are not in the team {team.name!r} any more; try again.")


def locked(*teams: Team | None) -> list[Team]:
    """These teams as they are now, which stay so until the transaction ends, in the order of their ids."""
    ids = [team.pk for team in teams if team is not None]
    return list(Team.objects.select_for_update(no_key=True).filter(pk__in=ids).order_by("pk"))


def present_membership(user: User, *also: Team) -> Membership | None:
    """Where the person is, with that team and these others locked. Raises `Refused` if that changed."""
    User.objects.select_for_update(no_key=True).get(pk=user.pk)
    seen = Membership.objects.filter(user=user).select_related("team").first()
    locked(*also, seen.team if seen else None)
    found = Membership.objects.filter(user=user).select_related("team").first()
    if (found and found.team_id) != (seen and seen.team_id):
        raise Refused("changed-meanwhile", "Your team has just changed; look again, and try again.")
    return found


def end_if_empty(team: Team) -> bool:
    """Forget a team that nobody is in and that has nothing. Returns whether it is gone."""
    # Rules that a maintainer gave it are a reason to keep it: they say something of those who were in it.
    rests = (
        team.memberships.exists()
        or Method.objects.filter(team=team).exists()
        or QuotaOverride.objects.filter(team=team).exists()
    )
    if not rests:
        Team.objects.filter(pk=team.pk).delete()
    return not rests


def end_invitations(team: Team, *, of: User) -> None:
    """End the links that somebody made who is not in the team any more: they would still open its door."""
    links = Invitation.objects.filter(team=team, created_by=of, accepted_at=None, revoked_at=None)
    links.update(revoked_at=Now())


def _membership_in(team: Team, user: User) -> Membership:
    found = team.memberships.filter(user=user).first()
    if found is None:
        raise Refused(
            "not-a-member", f"That person is not in the team {team.name!r}; expected one of its members."
        )
    return found


def _taken(name: str) -> Refused:
    return Refused(
        "name-taken", f"There is a team whose name looks like {name!r}; expected another one.", field="name"
    )


def _named(wanted: str) -> Team:
    """A new team of that name, numbered if others have it."""
    wanted = wanted[: MAX_NAME - _ROOM_FOR_A_NUMBER]
    for number in range(1, 10_000):
        name = wanted if number == 1 else f"{wanted} {number}"
        try:
            with transaction.atomic():
                return Team.objects.create(name=name, look=look(name))
        except IntegrityError:
            continue
    raise RuntimeError(f"ten thousand teams are called {wanted!r}")


def _founded(team: Team, user: User) -> Team:
    """The new team with its first member; or the one that another request of the same person made first."""
    try:
        with transaction.atomic():
            Membership.objects.create(team=team, user=user, is_owner=True)
            audit.record(verb="created", noun="Team", noun_id=team.pk, actor=user)
    except IntegrityError:
        team.delete()
        return team_of(user=user)
    return team
