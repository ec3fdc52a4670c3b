"""Locks of accounts, and the role of maintainers."""

from django.db import transaction

from leaderboard import audit
from leaderboard.errors.refusals import Refused, clean_text
from leaderboard.models import User

MAX_REASON = 500


def hold(user: User) -> User:
    """Lock and return the account."""
    return User.objects.select_for_update(no_key=True).get(pk=user.pk)


def hold_open(user: User) -> User:
    """Lock and return the account. Raises `Refused` if it is closed or deleted."""
    row = hold(user)
    require_open(row)
    return row


def require_open(row: User) -> None:
    """Raise `Refused` if the account is closed or deleted."""
    if not row.is_active:
        raise Refused("account-closed", "This account is closed or deleted.")


def set_maintainer(*, user: User, is_maintainer: bool, reason: str) -> User:
    """Give or end the role of a maintainer. Raises `Refused`."""
    reason = clean_text("reason", reason, limit=MAX_REASON)
    with transaction.atomic():
        row = hold_open(user) if is_maintainer else hold(user)
        row.is_staff = row.is_superuser = is_maintainer
        row.save(update_fields=["is_staff", "is_superuser"])
        details = {"is_maintainer": is_maintainer, "reason": reason}
        audit.record_of(row, "changed", actor=None, details=details)
    return row
