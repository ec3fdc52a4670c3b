"""`manage.py forget_person EMAIL --reason TEXT`."""

import os
from typing import Any

from django.core.management.base import CommandError
from django.utils import timezone

from leaderboard.management.arguments import AccountCommand, account_of
from leaderboard.ops import environment
from leaderboard.submissions import forgetting

_KEY = "TSTTC_SECRET_KEY"


class Command(AccountCommand):
    """Deletes everything that names a person."""

    help = "Delete the account of a person and everything that names them. Scores stay."

    def handle(self, *args: Any, **options: Any) -> None:
        """Forget, and say the number by which the audit log still knows the account."""
        user = account_of(options)
        reason = options["reason"].strip()
        if not reason:
            raise CommandError("No reason was given; expected a sentence for the audit log.")
        if environment.PRODUCTION and not os.environ.get(_KEY):
            raise CommandError(
                f"{_KEY} is not set; expected the one of the web processes: a hash made with it keeps "
                "the quota of the mailbox used. With containers: "
                "docker compose exec web python manage.py forget_person …"
            )
        forgetting.forget(user=user, reason=reason, actor=None, now=timezone.now())
        self.stdout.write(f"The person is forgotten. The audit log has the number {user.pk}.")
