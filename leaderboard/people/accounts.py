"""Accounts, locked while something is written that belongs to one."""

from django.db import transaction

from leaderboard import audit
from leaderboard.errors.refusals import Refused, clean_text
from leaderboard.models import User

MAX_REASON = 500


def hold(user: User) -> User:
    """The account, locked."""
    return User.objects.select_for_update(no_key=True).get(pk=user.pk)


def hold_open(user: User) -> User:
    """The same. Raises `Refused` for an account that is closed or deleted."""
    row = hold(user)
    require_open(row)
    return row


def require_open(row: User) -> None:
    """Raise `Refused` for an account that is closed or deleted."""
    if not row.is_active:
        raise Refused("account-closed", "This account is closed or deleted.")


def set_maintainer(*, user: User, is_maintainer: bool, reason: str) -> User:
    """Give the role of a maintainer to an account, or end it. Raises `Refused`."""
    reason = clean_text("reason", reason, limit=MAX_REASON)
    with transaction.atomic():
        row = hold_open(user) if is_maintainer else hold(user)
        row.is_staff = row.is_superuser = is_maintainer
        row.save(update_fields=["is_staff", "is_superuser"])
        details = {"is_maintainer": is_maintainer, "reason": reason}
        audit.record(verb="changed", noun="User", noun_id=row.pk, actor=None, details=details)
    return row
