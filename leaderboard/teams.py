"""Teams: who competes."""

from django.db import IntegrityError, transaction

from leaderboard import audit
from leaderboard.models import Membership, Team, User


def present_team_of(*, user: User) -> Team | None:
    """The person's team, if there is one yet."""
    return Team.objects.filter(memberships__user=user).first()


def team_of(*, user: User) -> Team:
    """The person's team; somebody without one becomes a team of one."""
    present = present_team_of(user=user)
    if present is not None:
        return present
    wanted = user.name.strip()
    # An address is nobody's business: somebody who gave no name gets one that reveals nothing.
    team = _named(wanted or f"Team {user.pk}")
    try:
        with transaction.atomic():
            Membership.objects.create(team=team, user=user, is_owner=True)
            audit.record(verb="created", noun="Team", noun_id=team.pk, actor=user)
    except IntegrityError:
        # Two requests of the same person at once: the other one was first.
        team.delete()
        return Membership.objects.select_related("team").get(user=user).team
    return team


def _named(wanted: str) -> Team:
    """A new team of that name, numbered if others have it."""
    for number in range(1, 10_000):
        name = wanted[:70] if number == 1 else f"{wanted[:70]} {number}"
        try:
            with transaction.atomic():
                return Team.objects.create(name=name)
        except IntegrityError:
            continue
    raise RuntimeError(f"ten thousand teams are called {wanted[:70]!r}")
