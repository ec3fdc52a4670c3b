"""Email addresses, in one spelling each. An account without a proved one gives way to the next sign-up."""

from datetime import datetime, timedelta

from allauth.account.models import EmailAddress
from django.conf import settings
from django.core.exceptions import ValidationError
from django.core.validators import validate_email
from django.db import transaction
from django.db.models import Exists, OuterRef, Q, QuerySet

from leaderboard.errors.refusals import Refused
from leaderboard.models import User
from leaderboard.models.addresses import fault_of, spelled

UNCONFIRMED_FOR = timedelta(days=1)


def accepted(text: str) -> str:
    """Return the one spelling of an address that an account may have from now on. Raises `Refused`."""
    address = spelled(text)
    try:
        validate_email(address)
    except ValidationError:
        fault = "That is no email address; expected one such as ada@example.org."
    else:
        fault = ""
    fault = fault_of(address) or fault
    if fault:
        raise Refused("bad-value", fault, field="email")
    return address


def stored(text: str) -> str:
    """Return the spelling under which an account has this address, for who signs in or resets a password."""
    # Only an account from before addresses had one spelling has another one.
    typed = text.strip().lower()
    is_old = User.objects.filter(email=typed).exists() or _rows_of(typed).exists()
    return typed if is_old else spelled(text)


def owners_of(address: str) -> QuerySet[User]:
    """Return the accounts that may reset their password by a mail to this address."""
    accounts = accounts_of(address).filter(is_active=True)
    proved = accounts.filter(Exists(_rows().filter(email=address, verified=True)))
    return proved if proved.exists() else accounts


def accounts_of(address: str) -> QuerySet[User]:
    """Return the accounts with this address; only proved ones where the site proves addresses."""
    has_it = Q(email__iexact=address)
    if not are_proved():
        return User.objects.filter(has_it | Exists(_rows().filter(email__iexact=address)))
    has_proved_it = Exists(_rows().filter(email__iexact=address, verified=True))
    return User.objects.filter(has_it | has_proved_it).exclude(_is_unconfirmed())


def is_unconfirmed(user: User) -> bool:
    """Tell whether the account was signed up for and never confirmed; False where nobody proves addresses."""
    return are_proved() and User.objects.filter(_is_unconfirmed(), pk=user.pk).exists()


def release(*, address: str, to: User | None = None) -> None:
    """Delete unconfirmed accounts with this address, except that of `to`."""
    if not are_proved():
        return
    others = User.objects.filter(email__iexact=address)
    _delete_unconfirmed(others.exclude(pk=to.pk) if to else others)


def delete_unproved(*, now: datetime) -> None:
    """Delete accounts that were not confirmed within `UNCONFIRMED_FOR`."""
    if are_proved():
        _delete_unconfirmed(User.objects.filter(date_joined__lt=now - UNCONFIRMED_FOR))


def _delete_unconfirmed(people: QuerySet[User]) -> None:
    with transaction.atomic():
        locked = people.filter(_is_unconfirmed()).select_for_update(no_key=True, of=("self",))
        # Asked again once the rows are locked: `AccountAdapter.confirm_email` locks them as well.
        User.objects.filter(_is_unconfirmed(), pk__in=[user.pk for user in locked]).delete()


def are_proved() -> bool:
    """Whether users must prove their addresses here."""
    return bool(settings.ACCOUNT_EMAIL_VERIFICATION == "mandatory")


def _rows() -> QuerySet[EmailAddress]:
    return EmailAddress.objects.filter(user=OuterRef("pk"))


def _rows_of(address: str) -> QuerySet[EmailAddress]:
    return EmailAddress.objects.filter(email=address)


def _is_unconfirmed() -> Q:
    is_unused = Q(last_login=None, is_staff=False, membership=None, submissions=None)
    return is_unused & Q(Exists(_rows())) & ~Q(Exists(_rows().filter(verified=True)))
