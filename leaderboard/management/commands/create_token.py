"""`manage.py create_token EMAIL --name NAME`."""

from argparse import ArgumentParser
from typing import Any

from django.core.exceptions import ValidationError
from django.core.management.base import BaseCommand, CommandError
from django.core.validators import validate_email

from leaderboard import tokens
from leaderboard.models import User


class Command(BaseCommand):
    """Makes an API token."""

    help = "Make an API token and print it, once. An address without an account gets one without a password."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """EMAIL and the token's name."""
        parser.add_argument("email")
        parser.add_argument("--name", required=True, help="what the token is for, such as 'nightly CI'")

    def handle(self, *args: Any, **options: Any) -> None:
        """The token on standard output, everything else on standard error."""
        email = options["email"].strip().lower()
        try:
            validate_email(email)
        except ValidationError as fault:
            raise CommandError(f"{email!r} is no e-mail address.") from fault
        user = User.objects.filter(email=email).first()
        if user is None:
            user = User.objects.create_user(email)
            self.stderr.write(
                f"No account had {email}; made one. Its password can be set by 'password reset'."
            )
        self.stdout.write(tokens.create(user=user, name=options["name"]))
        self.stderr.write("This is the only time the token is shown. It ends after 90 days.")
