"""`manage.py appoint_owner TEAM EMAIL --reason …`."""

import re
from argparse import ArgumentParser
from typing import Any, Final

from django.core.management.base import CommandError
from django.db.models import Q

from evaluator.counting import counted
from leaderboard.management.arguments import RefusingCommand
from leaderboard.models import Team, User
from leaderboard.people import teams

UUID_TEXT: Final = re.compile(r"[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")


class Command(RefusingCommand):
    """Makes a member the owner of their team."""

    help = "Make a member the owner of a team whose owner has no usable account."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """TEAM, EMAIL, reason."""
        parser.add_argument("team", help="the team's name, as boards show it, or its id")
        parser.add_argument("email", help="of the member who will own it")
        parser.add_argument("--reason", required=True, help="a sentence for the audit log")

    def handle(self, *args: Any, **options: Any) -> None:
        """Appoint, and say who owns the team now."""
        reason = options["reason"].strip()
        if not reason:
            raise CommandError("No reason was given; expected a sentence for the audit log.")
        team = _team(options["team"])
        email = options["email"].strip().lower()
        heir = User.objects.filter(email=email).first()
        if heir is None:
            raise CommandError(f"There is no account for {options['email']!r}.")
        teams.appoint(team=team, to=heir, reason=reason)
        self.stdout.write(f"{email} owns the team {team.name}.")


def _team(text: str) -> Team:
    """The team of this name or id. Teams that nobody sees may have one name, and then the id is asked for."""
    by_id = Q(pk=text) if UUID_TEXT.fullmatch(text) else Q()
    found = list(Team.objects.filter(Q(name=text) | by_id).order_by("created_at"))
    if not found:
        raise CommandError(f"No team is called {text!r}.")
    if len(found) > 1:
        ids = ", ".join(f"{team.pk} ({counted(team.memberships.count(), 'member')})" for team in found)
        raise CommandError(f"{len(found)} teams are called {text!r}; expected one of their ids: {ids}.")
    return found[0]
