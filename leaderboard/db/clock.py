"""The database's clock: the one that processes on several machines agree on."""

from datetime import datetime, timedelta

from django.db.models.expressions import CombinedExpression
from django.db.models.functions import Now
from django.utils import timezone

from leaderboard.models import Split


def after(seconds: float) -> CombinedExpression:
    """`seconds` from now, to be evaluated by the database."""
    return Now() + timedelta(seconds=seconds)


def database_now() -> datetime:
    """The time of the database's clock, to compare with times that it wrote."""
    row = Split.objects.annotate(now=Now()).values_list("now", flat=True).first()
    # Only a database without a single split, which no migrated one is, cannot be asked in this way.
    return timezone.now() if row is None else row
