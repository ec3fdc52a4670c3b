"""The one Django app."""

from django.apps import AppConfig


class LeaderboardConfig(AppConfig):
    """Everything that the leaderboard remembers and shows."""

    name = "leaderboard"
    verbose_name = "TSTTC leaderboard"
