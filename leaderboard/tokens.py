"""Tokens for CI jobs: hashed at rest, shown once."""

from datetime import timedelta

from django.db import transaction

from leaderboard import audit
from leaderboard.models import ApiToken, User

LIFETIME = timedelta(days=90)


def create(*, user: User, name: str, actor: User | None = None) -> str:
    """A new token of that person. The return value is the only place where it ever stands."""
    with transaction.atomic():
        row, token = ApiToken.objects.create(user=user, name=name[:80], expiry=LIFETIME)
        audit.record(
            verb="created",
            noun="ApiToken",
            noun_id=row.token_key,
            actor=actor or user,
            details={"name": name[:80]},
        )
    return token
