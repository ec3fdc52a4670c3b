"""A plugin of pytest that adds a method detail as a developer would: a field of `Method`, and one row."""

from django.apps import AppConfig
from django.db import models

from leaderboard.apps import LeaderboardConfig

_import_models = AppConfig.import_models


def import_models(config: AppConfig) -> None:
    """Import the app's models, and add the detail before anything else is imported."""
    _import_models(config)
    from leaderboard.methods import details  # noqa: PLC0415 - needs the models
    from leaderboard.models import Method  # noqa: PLC0415

    Method.add_to_class("mascot", models.CharField(max_length=40, blank=True))
    row = details.Detail(
        name="mascot",
        kind=details.free_text(40),
        label="Mascot",
        help="What the team calls the network.",
        filter="mascot",
        example="Owl",
    )
    details.DETAILS += (row,)


LeaderboardConfig.import_models = import_models  # type: ignore[assignment]  # for a process of its own
