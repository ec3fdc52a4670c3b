"""`manage.py seed_demo`."""

from typing import Any

from django.conf import settings
from django.core.management.base import BaseCommand, CommandError
from django.utils import timezone

from leaderboard.demo import seed


class Command(BaseCommand):
    """Fills the split `demo`."""

    help = "Give the split 'demo' simulated ground truth and submissions; what is there already stays."

    def handle(self, *args: Any, **options: Any) -> None:
        """Seed, and say how to sign in."""
        if settings.PRODUCTION:
            raise CommandError(
                "The demo makes an account whose password it prints; that is not for production."
            )
        try:
            login = seed.seed(now=timezone.now(), login_path=settings.DATA_DIR / "demo-password")
        except seed.Occupied as refused:
            raise CommandError(str(refused)) from refused
        self.stdout.write(f"Sign in as {login.email} with the password {login.password}")
