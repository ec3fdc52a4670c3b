"""Accounts that were taken over: the owner undoes it by a mailed link, or a maintainer gives them back.

Each change of how one signs in is kept with the proved addresses before it. For a week, every address that
the account had then can take it back; see `find` for which address may undo what.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from allauth.account.models import EmailAddress
from allauth.mfa.models import Authenticator
from allauth.socialaccount.models import SocialAccount
from django.conf import settings
from django.core import signing
from django.db import transaction
from django.db.models import QuerySet
from django.urls import reverse
from django.utils.crypto import salted_hmac

from leaderboard import audit
from leaderboard.errors.refusals import Refused, clean_text, require_maintainer
from leaderboard.mails import outbox
from leaderboard.models import AccountChange, Mail, MailKind, User
from leaderboard.people import accounts, addresses, sessions, tokens
from leaderboard.quotas import mailboxes

WEEK: Final = timedelta(days=7)
KEPT: Final = timedelta(days=30)
# So many former addresses are told, so that nobody can send mails to many.
MAX_RECIPIENTS: Final = 10
# The row of an app or of a connected account is a moment older than the change that tells of it.
_MOMENT: Final = timedelta(minutes=1)
_SALT: Final = "account-undo"


class UnusableLink(Exception):
    """The link undoes nothing, or nothing any more."""


@dataclass(frozen=True)
class Undo:
    """What a link can do. `changes` are those that it can undo from, the oldest first."""

    user: User
    address: str
    changes: Sequence[AccountChange]


def proved(user: User) -> list[str]:
    """Return the proved addresses of an account, the primary one first."""
    rows = EmailAddress.objects.filter(user=user, verified=True).order_by("-primary", "pk")
    return list(rows.values_list("email", flat=True))


# --- keeping what there is to undo ------------------------------------------------------------------------


def note(*, user: User, what: str, before: Sequence[str], now: datetime) -> dict[str, str]:
    """Keep a change. Returns the addresses to tell of it, each with its link."""
    change = AccountChange.objects.create(user=user, at=now, what=what, before=list(before))
    former = [
        address for row in reversed(_chain(user, now=now)) if row.at > now - WEEK for address in row.before
    ]
    return {address: _link(change, address) for address in list(dict.fromkeys(former))[:MAX_RECIPIENTS]}


def with_former_address(text: str) -> set[int]:
    """Return the keys of the accounts that had an address with this text in it, as far as it is kept."""
    part = text.strip().lower()
    rows = AccountChange.objects.values_list("user", "before")
    return {user for user, before in rows if part and any(part in address for address in before)}


def delete_old(*, now: datetime) -> None:
    AccountChange.objects.filter(at__lte=now - KEPT).delete()


def _link(change: AccountChange, address: str) -> str:
    secret = signing.dumps([change.pk, _digest(change.user, address)], salt=_SALT)
    return f"{settings.SITE_URL}{reverse('account_undo', args=[secret])}"


def _digest(user: User, address: str) -> str:
    # Addresses of pages stand in logs of proxies; people's addresses must not.
    return salted_hmac(_SALT, f"{user.pk}:{address}", algorithm="sha256").hexdigest()[:32]


def _chain(user: User, *, now: datetime) -> list[AccountChange]:
    """Return the changes that are not undone, the newest first, as far as each follows within a week.

    An attacker who takes one step in six days gains nothing.
    """
    chain: list[AccountChange] = []
    until = now
    for row in AccountChange.objects.filter(user=user, undone_at=None, at__lte=now).order_by("-at", "-pk"):
        if row.at <= until - WEEK:
            break
        chain.append(row)
        until = row.at
    return chain


# --- undoing it -------------------------------------------------------------------------------------------


def find(*, secret: str, now: datetime) -> Undo:
    """Return what a link can undo. Raises `UnusableLink`.

    The address must have been the account's within the week. Where an address that the account had earlier
    is still there, a later one has nothing to undo: else whoever was thrown out could come back.
    """
    try:
        change_id, digest = signing.loads(secret, salt=_SALT, max_age=WEEK)
    except (signing.BadSignature, ValueError, TypeError) as fault:
        raise UnusableLink("The link is incomplete, or older than a week.") from fault
    change = AccountChange.objects.filter(pk=change_id).select_related("user").first()
    if change is None or change.undone_at is not None:
        raise UnusableLink("The link was used already, or another link was used after it.")
    chain = _chain(change.user, now=now)
    in_week = [row for row in chain if row.at > now - WEEK]
    lately = {address for row in in_week for address in row.before}
    address = next((each for each in sorted(lately) if _digest(change.user, each) == digest), "")
    if change not in in_week or not address:
        raise UnusableLink("The change is older than a week.")
    if not change.user.is_active:
        raise UnusableLink("This account is closed or deleted.")
    order = [row for row in reversed(chain) if (row.at, row.pk) <= (change.at, change.pk)]
    had_it = [row for row in order if address in row.before]
    if not had_it:
        raise UnusableLink("Everything that this link undoes is undone.")
    earlier = {each for row in order if _is_before(row, had_it[0]) for each in row.before}
    if earlier & set(proved(change.user)):
        raise UnusableLink("An address that this account had earlier is still there: sign in with it.")
    return Undo(user=change.user, address=address, changes=had_it)


def _is_before(row: AccountChange, other: AccountChange) -> bool:
    return (row.at, row.pk) < (other.at, other.pk)


def undo(*, secret: str, since: int | None, now: datetime) -> User:
    """Bring back the addresses before a change, and end whatever was opened since.

    `since` is the key of one of the link's changes, by default the oldest. Returns the account, which then
    has no password. Raises `UnusableLink`, and `Refused` if another account has the address now.
    """
    with transaction.atomic():
        user = accounts.hold_open(find(secret=secret, now=now).user)
        # Asked again, now that nobody else changes the account.
        link = find(secret=secret, now=now)
        chosen = next((row for row in link.changes if row.pk == since), link.changes[0])
        lately = {each for row in _chain(user, now=now) if row.at > now - WEEK for each in row.before}
        present = proved(user)
        wanted = [each for each in chosen.before if each in lately or each in present]
        former = sorted({*lately, *present})
        taken = {each for each in wanted if each not in present and _is_taken(each, user)}
        if link.address in taken:
            raise Refused(
                "bad-value", "Another account has this address now; expected one that no other account has."
            )
        kept = [each for each in wanted if each not in taken]
        kept = kept if link.address in kept else [link.address, *kept]
        _set_addresses(user, kept, now=now)
        _shut(user, since=chosen.at - _MOMENT, now=now, actor=None, how="the account was recovered")
        AccountChange.objects.filter(user=user, undone_at=None, at__gte=chosen.at).update(undone_at=now)
        audit.record_of(user, "recovered", details={"n_changes": len(link.changes)})
        sentence = "Changes of your account were undone with a link that we had mailed"
        _tell(user, former, sentence=sentence, now=now)
    sessions.end_all(user=user, addresses=[each for each in former if each not in kept])
    return user


def give_back(*, user: User, address: str, reason: str, actor: User | None, now: datetime) -> None:
    """Give an account to the person with this address, and end every other way into it. Raises `Refused`."""
    require_maintainer(actor, to="give accounts back")
    reason = clean_text("reason", reason, limit=accounts.MAX_REASON)
    with transaction.atomic():
        row = accounts.hold_open(user)
        if row.is_staff:
            raise Refused(
                "permission-denied",
                "A maintainer's account cannot be given back; another maintainer ends the role first.",
            )
        if _is_taken(address, row):
            raise Refused(
                "bad-value",
                "Another account has this address; expected one that no other account has.",
                field="address",
            )
        former = proved(row)
        _set_addresses(row, [address], now=now)
        _shut(row, since=None, now=now, actor=actor, how=f"by a maintainer: {reason}")
        # No link of before brings anybody else back.
        AccountChange.objects.filter(user=row, undone_at=None).update(undone_at=now)
        audit.record_of(row, "given back", actor=actor, details={"reason": reason})
        sentence = "A maintainer gave your account back to the person who asked for it"
        _tell(row, sorted({*former, address}), sentence=sentence, now=now)
    sessions.end_all(user=row, addresses=[each for each in former if each != address])


def _is_taken(address: str, user: User) -> bool:
    return addresses.accounts_of(address).exclude(pk=user.pk).exists()


def _set_addresses(user: User, kept: Sequence[str], *, now: datetime) -> None:
    """Make these the addresses of the account, all proved, the first one primary."""
    # What was sent counts for the mailboxes of before and for those of now.
    mailboxes.keep(user=user, now=now)
    for address in kept:
        addresses.release(address=address, to=user)
    own: QuerySet[EmailAddress] = EmailAddress.objects.filter(user=user)
    own.exclude(email__in=kept).delete()
    own.update(primary=False)
    for number, address in enumerate(kept):
        EmailAddress.objects.update_or_create(
            user=user, email=address, defaults={"verified": True, "primary": number == 0}
        )
    user.email = kept[0]
    user.save(update_fields=["email"])
    mailboxes.keep(user=user, now=now)


def _shut(user: User, *, since: datetime | None, now: datetime, actor: User | None, how: str) -> None:
    """End passwords, tokens, apps and connected accounts; the last two only if they came later."""
    # Open sessions and mailed links to reset the password rest on it.
    user.set_unusable_password()
    user.save(update_fields=["password"])
    for token in user.auth_token_set.filter(revoked_at=None):
        tokens.revoke(token=token, now=now, actor=actor, how=how)
    apps, connected = Authenticator.objects.filter(user=user), SocialAccount.objects.filter(user=user)
    if since is not None:
        apps, connected = apps.filter(created_at__gte=since), connected.filter(date_joined__gte=since)
    apps.delete()
    connected.delete()


def _tell(user: User, recipients: Sequence[str], *, sentence: str, now: datetime) -> None:
    name = settings.BENCHMARK.site_name
    text = (
        f"{sentence}. All sessions and API tokens of the account have ended. To sign in, choose a new "
        f"password:\n\n{settings.SITE_URL}{reverse('account_reset_password')}\n\n"
        f"If you did not expect this, write to {settings.CONTACT_EMAIL}.\n\n--\n{name}\n{settings.SITE_URL}\n"
    )
    outbox.queue(
        [
            Mail(
                kind=MailKind.ACCOUNT,
                user=user,
                recipient=recipient,
                subject=f"[{name}] Your account was given back",
                text=text,
                queued_at=now,
                due_at=now,
            )
            for recipient in recipients[:MAX_RECIPIENTS]
        ]
    )
