"""The second factor of an account, kept by allauth: who must have one, and its reset."""

from allauth.mfa.models import Authenticator
from django.conf import settings
from django.db import transaction

from leaderboard import audit
from leaderboard.errors.refusals import Refused, clean_text
from leaderboard.models import AuditEvent, User


def is_required(user: User) -> bool:
    """Tell whether this person acts as a maintainer only with a second factor."""
    return bool(settings.REQUIRE_SECOND_FACTOR) and user.is_maintainer


def is_set_up(user: User) -> bool:
    """Tell whether an authenticator app is set up."""
    return Authenticator.objects.filter(user=user, type=Authenticator.Type.TOTP).exists()


def reset(*, user: User, reason: str) -> AuditEvent:
    """Delete an account's second factor and recovery codes. Raises `Refused` without a reason or a factor."""
    reason = clean_text("reason", reason, limit=500)
    with transaction.atomic():
        n_deleted, _ = Authenticator.objects.filter(user=user).delete()
        if not n_deleted:
            raise Refused(
                "bad-value", "The account has no two-factor authentication; there is nothing to switch off."
            )
        return audit.record_of(user, "second factor reset", details={"reason": reason})
