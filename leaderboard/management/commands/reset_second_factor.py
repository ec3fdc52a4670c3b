"""`manage.py reset_second_factor EMAIL --reason TEXT`."""

from typing import Any

from django.conf import settings
from django.utils import timezone

from leaderboard.mails import outbox
from leaderboard.management.arguments import AccountCommand, account_of
from leaderboard.models import MailKind
from leaderboard.people import second_factor

_MAIL = (
    "A maintainer switched off two-factor authentication for your account and deleted its recovery codes. "
    "If you did not ask for this, write to us now: {contact}\n\n"
    "Set it up again here:\n\n{site}/accounts/2fa/\n\n--\n{name}\n{site}"
)


class Command(AccountCommand):
    help = (
        "Switch off two-factor authentication of an account whose owner lost the app and the recovery codes."
    )

    def handle(self, *args: Any, **options: Any) -> None:
        user = account_of(options)
        event = second_factor.reset(user=user, reason=options["reason"])
        name = settings.BENCHMARK.site_name
        text = _MAIL.format(contact=settings.CONTACT_EMAIL, site=settings.SITE_URL, name=name)
        mail = outbox.notice(
            kind=MailKind.ACCOUNT,
            user=user,
            key=f"second-factor-reset:{event.pk}",
            subject=f"[{name}] Two-factor authentication is off",
            text=text,
            now=timezone.now(),
        )
        outbox.queue([mail])
        self.stdout.write("Two-factor authentication is off. The person is told by mail.")
