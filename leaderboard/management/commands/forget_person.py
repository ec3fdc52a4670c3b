"""`manage.py forget_person EMAIL --reason TEXT`."""

from argparse import ArgumentParser
from typing import Any

from django.core.management.base import CommandError
from django.utils import timezone

from leaderboard.management.refusing import RefusingCommand
from leaderboard.models import User
from leaderboard.submissions import forgetting


class Command(RefusingCommand):
    """Deletes everything that names a person."""

    help = "Delete the account of a person and everything that names them. Scores stay."

    def add_arguments(self, parser: ArgumentParser) -> None:
        """EMAIL, reason."""
        parser.add_argument("email", help="address of the account")
        parser.add_argument("--reason", required=True, help="a sentence for the audit log, without names")

    def handle(self, *args: Any, **options: Any) -> None:
        """Forget, and say the number by which the audit trail still knows the account."""
        user = User.objects.filter(email=options["email"].strip().lower()).first()
        if user is None:
            raise CommandError("There is no account with that address; expected the primary address of one.")
        reason = options["reason"].strip()
        if not reason:
            raise CommandError("No reason was given; expected a sentence for the audit log.")
        forgetting.forget(user=user, reason=reason, actor=None, now=timezone.now())
        self.stdout.write(f"The person is forgotten. The audit log has the number {user.pk}.")
