"""`manage.py appoint_owner TEAM EMAIL --reason …`."""

from argparse import ArgumentParser
from typing import Any

from django.core.management.base import BaseCommand, CommandError

from leaderboard import teams
from leaderboard.models import Team, User
from leaderboard.texts import Refused


class Command(BaseCommand):
    """Makes a member the owner of their team."""

    help = "Make a member the owner of their team, where its owner's account is closed or out of reach."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """TEAM, EMAIL, reason."""
        parser.add_argument("team", help="the team's name, as boards show it")
        parser.add_argument("email", help="of the member who will own it")
        parser.add_argument("--reason", required=True, help="a sentence for the audit trail")

    def handle(self, *args: Any, **options: Any) -> None:
        """Appoint, and say who owns the team now."""
        reason = options["reason"].strip()
        if not reason:
            raise CommandError("No reason was given; expected a sentence for the audit trail.")
        team = Team.objects.filter(name=options["team"]).first()
        if team is None:
            raise CommandError(f"No team is called {options['team']!r}.")
        email = options["email"].strip().lower()
        heir = User.objects.filter(email=email).first()
        if heir is None:
            raise CommandError(f"There is no account for {options['email']!r}.")
        try:
            teams.appoint(team=team, to=heir, reason=reason)
        except Refused as refusal:
            raise CommandError(str(refusal)) from refusal
        self.stdout.write(f"{email} owns the team {team.name}.")
