"""Email addresses where the site proves them: one that nobody has proved takes nothing from its owner.

An account that somebody signed up and never confirmed gives way to the next sign-up with its address, and is
deleted after a day. So does an unproved address beside the primary one, which only older versions kept.
"""

from datetime import datetime, timedelta

from allauth.account.models import EmailAddress
from django.conf import settings
from django.db import transaction
from django.db.models import Exists, F, OuterRef, Q, QuerySet

from leaderboard.models import User

UNCONFIRMED_FOR = timedelta(days=1)


def accounts_of(address: str) -> QuerySet[User]:
    """The accounts that this address belongs to: at most one, where it is proved.

    Where the site proves no addresses, also those that have it unproved.
    """
    has_it = Q(email__iexact=address)
    if not _are_proved():
        return User.objects.filter(has_it | Exists(_rows().filter(email__iexact=address)))
    has_proved_it = Exists(_rows().filter(email__iexact=address, verified=True))
    return User.objects.filter(has_it | has_proved_it).exclude(_is_unconfirmed())


def release(*, address: str, to: User | None = None) -> None:
    """Take the address from everybody who has not proved it, but not from the person who does so now."""
    if not _are_proved():
        return
    kept = User.objects.filter(pk=to.pk) if to else User.objects.none()
    with transaction.atomic():
        EmailAddress.objects.filter(_is_spare(), email__iexact=address).exclude(user__in=kept).delete()
        _delete_unconfirmed(User.objects.filter(email__iexact=address).exclude(pk__in=kept))


def delete_unproved(*, now: datetime) -> None:
    """Delete accounts that nobody confirmed within a day, and spare addresses."""
    if _are_proved():
        EmailAddress.objects.filter(_is_spare()).delete()
        _delete_unconfirmed(User.objects.filter(date_joined__lt=now - UNCONFIRMED_FOR))


def _delete_unconfirmed(people: QuerySet[User]) -> None:
    with transaction.atomic():
        locked = people.filter(_is_unconfirmed()).select_for_update(no_key=True, of=("self",))
        # Asked again once the rows are locked: `AccountAdapter.confirm_email` locks them as well.
        User.objects.filter(_is_unconfirmed(), pk__in=[user.pk for user in locked]).delete()


def _are_proved() -> bool:
    return bool(settings.ACCOUNT_EMAIL_VERIFICATION == "mandatory")


def _rows() -> QuerySet[EmailAddress]:
    return EmailAddress.objects.filter(user=OuterRef("pk"))


def _is_unconfirmed() -> Q:
    """Somebody signed it up, and nobody has ever been in it."""
    is_unused = Q(last_login=None, is_staff=False, membership=None, submissions=None)
    return is_unused & Q(Exists(_rows())) & ~Q(Exists(_rows().filter(verified=True)))


def _is_spare() -> Q:
    """An unproved address that is not the one of the account."""
    return Q(verified=False) & ~Q(email__iexact=F("user__email"))
