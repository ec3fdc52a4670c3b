"""The one Django app."""

from django.apps import AppConfig
from django.core import checks


class LeaderboardConfig(AppConfig):
    name = "leaderboard"
    verbose_name = "Leaderboard"

    def ready(self) -> None:
        # Only now can the modules of the system checks be imported.
        from leaderboard.ops import deployment  # noqa: PLC0415 - needs the models
        from leaderboard.pages import texts  # noqa: PLC0415 - needs the models
        from leaderboard.submissions import receipts  # noqa: PLC0415 - needs the models

        checks.register(receipts.check_keys)
        checks.register(receipts.check_public_key, deploy=True)
        checks.register(texts.check_contact, deploy=True)
        checks.register(deployment.check_variables, deploy=True)
        checks.register(deployment.check_services, deploy=True)
