"""`manage.py forget_person EMAIL --reason TEXT`."""

from typing import Any

from django.core.management.base import CommandError
from django.utils import timezone

from leaderboard.management.arguments import AccountCommand, account_of
from leaderboard.submissions import forgetting


class Command(AccountCommand):
    """Deletes everything that names a person."""

    help = "Delete the account of a person and everything that names them. Scores stay."

    def handle(self, *args: Any, **options: Any) -> None:
        """Forget, and say the number by which the audit log still knows the account."""
        user = account_of(options)
        reason = options["reason"].strip()
        if not reason:
            raise CommandError("No reason was given; expected a sentence for the audit log.")
        forgetting.forget(user=user, reason=reason, actor=None, now=timezone.now())
        self.stdout.write(f"The person is forgotten. The audit log has the number {user.pk}.")
