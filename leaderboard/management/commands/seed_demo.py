"""`manage.py seed_demo`."""

from typing import Any

from django.conf import settings
from django.core.management.base import CommandError
from django.utils import timezone

from leaderboard.demo import seed
from leaderboard.management.arguments import RefusingCommand


class Command(RefusingCommand):
    help = "Give the split 'demo' simulated ground truth and submissions; existing data stays."

    def handle(self, *args: Any, **options: Any) -> None:
        if settings.PRODUCTION:
            raise CommandError("The demo creates an account and prints its password; not for production.")
        password = seed.seed(now=timezone.now(), password_path=settings.DATA_DIR / "demo-password")
        self.stdout.write(f"Sign in as {seed.DEMO_EMAIL} with the password {password}")
        self.stdout.write(f"Maintain as {seed.MAINTAINER_EMAIL} with the same password")
