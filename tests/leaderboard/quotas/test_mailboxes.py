"""Submissions of a mailbox count after its account is deleted, until the last window ends."""

from datetime import timedelta

import pytest
from allauth.account.models import EmailAddress
from django.core import serializers
from django.utils import timezone
from pytest_django.fixtures import Settings

from leaderboard.models import Edition, SpentMailbox, Split, Submission, User
from leaderboard.moderation import forgetting
from leaderboard.people import teams
from leaderboard.quotas import usage
from leaderboard.quotas.usage import QuotaExceeded
from leaderboard.upkeep import pollers
from tests import builders
from tests.leaderboard.web.account import proving

DAY = timedelta(days=1)
PASSWORD = proving.PASSWORD


@pytest.fixture
def limited(edition: Edition, settings: Settings) -> Edition:
    """The test split with three submissions in 30 days, on a site that proves addresses."""
    Split.objects.filter(pk="test").update(quota_limit=3, quota_window=30 * DAY)
    proving.proving(settings)
    return edition


def account(email: str) -> User:
    user = User.objects.create_user(email, PASSWORD)
    EmailAddress.objects.create(user=user, email=user.email, verified=True, primary=True)
    return user


def send(edition: Edition, user: User, *factors: float) -> None:
    for factor in factors:
        builders.submit(
            user, builders.predictions(edition, factor=factor), method=f"M{factor}", visibility="PRIVATE"
        )
    builders.score_all()


def forget(user: User) -> None:
    forgetting.forget(user=user, reason="R", actor=user, now=timezone.now())


def left(user: User) -> int | None:
    split = Split.objects.get(pk="test")
    team = teams.current_team_of(user=user)
    return usage.state(team=team, user=user, split=split, now=timezone.now()).left


# --- the attack ---------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_user_who_sends_deletes_and_signs_up_again_has_no_other_quota(limited: Edition) -> None:
    send(limited, account("x@example.org"), 1.1, 1.2, 1.3)
    for email in ("x@example.org", "X@Example.org", "x+1@example.org"):
        forget(User.objects.get(is_active=True))
        again = account(email)
        with pytest.raises(QuotaExceeded, match="Your team has used 3 submissions to Test"):
            send(limited, again, 2.0)
    send(limited, account("y@example.org"), 3.0)
    # Who is forgotten twice is forgotten once.
    for _ in range(2):
        forget(again)
    assert SpentMailbox.objects.filter(account=again).count() == 0


@pytest.mark.slow
def test_every_proved_address_of_the_deleted_account_counts_and_others_do_not(limited: Edition) -> None:
    first = account("x@example.org")
    EmailAddress.objects.create(user=first, email="proved+1@example.org", verified=True)
    EmailAddress.objects.create(user=first, email="victim@example.org", verified=False)
    send(limited, first, 1.1, 1.2)
    forget(first)
    theirs = [account(f"{name}@example.org") for name in ("x+2", "proved", "victim")]
    assert [left(user) for user in theirs] == [1, 1, 3]
    other = account("other@example.org")
    EmailAddress.objects.create(user=other, email="X+9@example.org", verified=True)
    assert left(other) == 1


# --- what is kept, and how long -----------------------------------------------------------------------------


def test_what_is_kept_names_nobody_and_goes_with_the_longest_window(limited: Edition) -> None:
    first = account("kestrel@example.org")
    send(limited, first, 1.1)
    sent_at = Submission.objects.get().submitted_at
    forget(first)
    row = SpentMailbox.objects.get()
    assert (row.account, row.kept_until) == (first, sent_at + 30 * DAY)
    tables = (SpentMailbox, User, EmailAddress, Submission)
    everything = "".join(serializers.serialize("json", model._base_manager.all()) for model in tables)
    assert [text for text in ("kestrel", "example.org") if text in everything] == []
    pollers.clean(now=row.kept_until - timedelta(seconds=1))
    assert SpentMailbox.objects.exists()
    pollers.clean(now=row.kept_until)
    assert not SpentMailbox.objects.exists()
    assert Submission.objects.get().submitted_by == first


def test_the_longest_rule_of_any_team_decides(limited: Edition, owner: User, maintainer: User) -> None:
    team = teams.team_of(user=owner)
    builders.override(team, min_gap=45 * DAY, actor=maintainer, now=timezone.now())
    send(limited, owner, 1.1)
    forget(owner)
    assert SpentMailbox.objects.get().kept_until == Submission.objects.get().submitted_at + 45 * DAY


def test_who_has_sent_nothing_lately_leaves_nothing(limited: Edition) -> None:
    first, second = account("x@example.org"), account("y@example.org")
    forget(first)
    send(limited, second, 1.1)
    Submission.objects.update(submitted_at=timezone.now() - 31 * DAY)
    pollers.clean(now=timezone.now() + 31 * DAY)
    forget(second)
    assert not SpentMailbox.objects.exists()


def test_where_addresses_are_not_proved_nothing_is_kept_and_nothing_counts(
    limited: Edition, settings: Settings
) -> None:
    first = account("x@example.org")
    settings.ACCOUNT_EMAIL_VERIFICATION = "none"
    send(limited, first, 1.1, 1.2, 1.3)
    forget(first)
    assert not SpentMailbox.objects.exists()
    assert left(account("x@example.org")) == 3


@pytest.mark.slow
def test_a_new_secret_key_separates_a_mailbox_from_what_it_had_sent(
    limited: Edition, settings: Settings
) -> None:
    first = account("x@example.org")
    send(limited, first, 1.1, 1.2, 1.3)
    forget(first)
    second = account("x@example.org")
    assert left(second) == 0
    settings.SECRET_KEY = "another"
    assert left(second) == 3
