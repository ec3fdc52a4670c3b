"""Mailboxes, by which accounts count as one person's.

An account counts for the mailbox of each of its proved addresses. Whatever it sends goes on counting for the
mailboxes that it had then, also after an address or the account is gone: their keyed hashes are kept until no
window reaches the files. The key comes from `SECRET_KEY`: with another one, the hashes match nothing.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime, timedelta

from allauth.account.models import EmailAddress
from django.db.models import Count, Max, Q, QuerySet
from django.utils.crypto import salted_hmac

from leaderboard.models import OldAddress, QuotaOverride, SpentMailbox, Split, Submission, User
from leaderboard.models.addresses import mailbox_of
from leaderboard.models.people import MAILBOX
from leaderboard.people import addresses


@dataclass(frozen=True)
class Mates:
    """The accounts that have a mailbox in common with some people, and what others sent from one of these."""

    accounts: QuerySet[User]
    spent: tuple[SpentMailbox, ...]

    def sent(self) -> Q:
        """Match the submissions of all of them."""
        theirs = Q(submitted_by__in=self.accounts.values("pk"))
        for row in self.spent:
            theirs |= Q(submitted_by=row.account_id, submitted_at__lte=row.sent_until)
        return theirs


def mates(people: QuerySet[User]) -> Mates:
    """Return who counts together with these people, who are among them.

    Where addresses are not proved, that is nobody else: anybody could spend somebody else's quota under an
    address like theirs.
    """
    if not addresses.are_proved():
        return Mates(people, ())
    wanted = _mailboxes(people)
    old = OldAddress.objects.filter(mailbox__in=wanted).values("address")
    proved = EmailAddress.objects.filter(verified=True).alias(mailbox=MAILBOX)
    has_one = Q(mailbox__in=wanted) | Q(email__in=old)
    has_proved_one = Q(pk__in=proved.filter(has_one).values("user"))
    spent = SpentMailbox.objects.filter(digest__in=_digests(wanted)).order_by("account", "digest")
    return Mates(User.objects.filter(has_one | has_proved_one), tuple(spent))


def keep(*, user: User, now: datetime) -> None:
    """Keep the hashes of an account's mailboxes if it has sent files lately.

    Called with each file, with each newly proved address, and before the account is blanked: whatever becomes
    of an address, what was sent from it is known.
    """
    sent_at = Submission.objects.filter(submitted_by=user).aggregate(at=Max("submitted_at"))["at"]
    if sent_at is None or not addresses.are_proved():
        return
    kept_until = sent_at + longest_window()
    if kept_until > now:
        digests = _digests(_mailboxes(User.objects.filter(pk=user.pk)))
        SpentMailbox.objects.bulk_create(
            [
                SpentMailbox(account=user, digest=digest, sent_until=sent_at, kept_until=kept_until)
                for digest in sorted(digests)
            ],
            update_conflicts=True,
            unique_fields=["account", "digest"],
            update_fields=["sent_until", "kept_until"],
        )


@dataclass(frozen=True)
class Domain:
    """The accounts with an address of one domain, and the files that they sent to hidden splits lately."""

    name: str
    n_accounts: int
    n_files: int


def busiest_domains(*, now: datetime, n_most: int = 20) -> list[Domain]:
    """Return the domains with two accounts or more, first those that sent most to hidden splits.

    Who has a domain has any number of mailboxes, which count as so many people.
    """
    sent = Count(
        "submissions",
        filter=Q(submissions__split__is_hidden=True, submissions__submitted_at__gt=now - longest_window()),
    )
    people = User.objects.filter(is_active=True).annotate(n_files=sent)
    totals: dict[str, tuple[int, int]] = {}
    for email, n_files in people.values_list("email", "n_files"):
        name = email.rpartition("@")[2]
        n_accounts, n_before = totals.get(name, (0, 0))
        totals[name] = (n_accounts + 1, n_before + n_files)
    domains = [Domain(name, *counts) for name, counts in totals.items() if counts[0] > 1]
    domains.sort(key=lambda domain: (-domain.n_files, -domain.n_accounts, domain.name))
    return domains[:n_most]


def delete_expired(*, now: datetime) -> None:
    """Delete the hashes that no window needs any more."""
    SpentMailbox.objects.filter(kept_until__lte=now).delete()


def longest_window() -> timedelta:
    """Return the longest window of any split and team, a day at least."""
    rules = [*Split.objects.all(), *QuotaOverride.objects.all()]
    windows = [timedelta(days=1)]
    for row in rules:
        windows += [row.quota_window, row.quota_min_gap]
    return max(windows)


def _mailboxes(people: QuerySet[User]) -> set[str]:
    proved = EmailAddress.objects.filter(user__in=people, verified=True).values_list("email", flat=True)
    return {mailbox_of(address) for address in (*people.values_list("email", flat=True), *proved)}


def _digests(mailboxes: Iterable[str]) -> set[str]:
    return {salted_hmac(__name__, mailbox, algorithm="sha256").hexdigest() for mailbox in mailboxes}
