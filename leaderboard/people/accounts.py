"""Accounts, held while something is written that belongs to one: nobody deletes the account meanwhile."""

from leaderboard.errors.refusals import Refused
from leaderboard.models import User


def hold(user: User) -> User:
    """The account as it is, which stays so until the transaction ends."""
    return User.objects.select_for_update(no_key=True).get(pk=user.pk)


def hold_open(user: User) -> User:
    """The same. Raises `Refused` for an account that is closed or deleted."""
    row = hold(user)
    require_open(row)
    return row


def require_open(row: User) -> None:
    """Raise `Refused` for an account that is closed or deleted; certain for whoever holds it."""
    if not row.is_active:
        raise Refused("account-closed", "This account is closed or deleted.")
