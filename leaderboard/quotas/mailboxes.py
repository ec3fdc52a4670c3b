"""Keyed hashes of deleted accounts' mailboxes, so that deletion gives no new quota.

The key comes from `SECRET_KEY`: with another one, the hashes match nothing.
"""

from datetime import datetime, timedelta

from allauth.account.models import EmailAddress
from django.db.models import Max, QuerySet
from django.utils.crypto import salted_hmac

from leaderboard.models import QuotaOverride, SpentMailbox, Split, Submission, User
from leaderboard.models.people import MAILBOX
from leaderboard.people import addresses


def keep(*, user: User, now: datetime) -> None:
    """Keep the hashes of an account's mailboxes if it has sent files lately, before it is blanked."""
    sent_at = Submission.objects.filter(submitted_by=user).aggregate(at=Max("submitted_at"))["at"]
    if sent_at is None or not addresses.are_proved():
        return
    kept_until = sent_at + longest_window()
    if kept_until > now:
        SpentMailbox.objects.bulk_create(
            SpentMailbox(account=user, digest=digest, kept_until=kept_until)
            for digest in sorted(_digests(User.objects.filter(pk=user.pk)))
        )


def deleted_accounts(people: QuerySet[User]) -> list[int]:
    """Return the deleted accounts with these people's mailboxes."""
    rows = SpentMailbox.objects.filter(digest__in=_digests(people))
    return list(rows.values_list("account", flat=True))


def delete_expired(*, now: datetime) -> None:
    """Delete the hashes that no window needs any more."""
    SpentMailbox.objects.filter(kept_until__lte=now).delete()


def longest_window() -> timedelta:
    """Return the longest window of any split and team, a day at least."""
    rules = [*Split.objects.all(), *QuotaOverride.objects.all()]
    return max(timedelta(days=1), *(span for row in rules for span in (row.quota_window, row.quota_min_gap)))


def _digests(people: QuerySet[User]) -> set[str]:
    proved = EmailAddress.objects.filter(user__in=people, verified=True).annotate(mailbox=MAILBOX)
    mailboxes = people.values_list("mailbox", flat=True).union(proved.values_list("mailbox", flat=True))
    return {salted_hmac(__name__, mailbox, algorithm="sha256").hexdigest() for mailbox in mailboxes}
