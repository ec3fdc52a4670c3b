"""`manage.py create_token EMAIL --name NAME`."""

from argparse import ArgumentParser
from typing import Any

from django.db import transaction
from django.utils import timezone

from evaluator.counting import counted
from leaderboard.management.arguments import RefusingCommand
from leaderboard.models import Scope, User
from leaderboard.people import addresses, tokens


class Command(RefusingCommand):
    help = "Create an API token and print it once. An address without an account gets one without a password."

    def add_arguments(self, parser: ArgumentParser) -> None:
        parser.add_argument("email")
        parser.add_argument("--name", required=True, help="name of the token, such as 'nightly CI'")
        parser.add_argument(
            "--scope",
            action="append",
            choices=Scope.values,
            help="scope of the token; may be given several times (default: read and submit)",
        )
        parser.add_argument("--split", default="", help="restrict the token to this split (default: all)")
        parser.add_argument(
            "--days",
            type=int,
            default=tokens.DAYS,
            help=f"when it expires, at most {tokens.MAX_DAYS} (%(default)s)",
        )

    def handle(self, *args: Any, **options: Any) -> None:
        with transaction.atomic():
            secret = tokens.create(
                user=self._account(options["email"]),
                name=options["name"],
                scopes=options["scope"] or tokens.USUAL_SCOPES,
                split_name=options["split"],
                days=options["days"],
                now=timezone.now(),
            )
        self.stdout.write(secret)
        self.stderr.write(
            f"The token is shown only once. It expires after {counted(options['days'], 'day')}."
        )

    def _account(self, text: str) -> User:
        user = User.objects.filter(email=addresses.stored(text)).first()
        if user is None:
            email = addresses.accepted(text)
            user = User.objects.create_user(email)
            self.stderr.write(
                f"No account had {email}; made one. Its password can be set by 'password reset'."
            )
        return user
