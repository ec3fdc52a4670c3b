"""Quota follows people: nobody gets another turn by changing teams, and no team by changing people."""

from datetime import timedelta

import pytest
from django.utils import timezone
from pytest_django.fixtures import Settings

from leaderboard.models import Edition, Method, Split, User
from leaderboard.people import invitations, teams
from leaderboard.quotas import usage
from leaderboard.quotas.usage import Quota, QuotaExceeded
from tests import builders

DAY = timedelta(days=1)


@pytest.fixture
def limited(edition: Edition) -> Edition:
    """The test split, with three submissions in 30 days."""
    Split.objects.filter(pk="test").update(quota_limit=3, quota_window=30 * DAY)
    return edition


def state(user: User) -> Quota:
    split = Split.objects.get(pk="test")
    return usage.state(team=teams.current_team_of(user=user), user=user, split=split, now=timezone.now())


def send(edition: Edition, user: User, *factors: float) -> None:
    for factor in factors:
        builders.submit(user, builders.predictions(edition, factor=factor), method=f"M{factor}")
    builders.score_all()


def join(user: User, owner: User) -> None:
    now = timezone.now()
    team = teams.team_of(user=owner)
    secret = invitations.make(team=team, actor=owner, now=now)[1]
    invitations.accept(secret=secret, user=user, now=now)


def test_who_leaves_takes_what_they_sent_along_and_the_team_keeps_what_it_got(
    limited: Edition, owner: User, teammate: User
) -> None:
    send(limited, teammate, 1.1, 1.2, 1.3)
    teams.leave(user=teammate)
    assert teams.current_team_of(user=teammate) is None
    assert (state(teammate).left, state(owner).left) == (0, 0)
    with pytest.raises(QuotaExceeded):
        send(limited, teammate, 1.4)
    assert state(teammate).left == 0


# --- two people who put their quotas together ---------------------------------------------------------------


@pytest.fixture
def shipped(edition: Edition) -> Edition:
    """The test split with the rules that it has from the start: three in 30 days, 24 hours apart."""
    Split.objects.filter(pk="test").update(quota_limit=3, quota_window=30 * DAY, quota_min_gap=DAY)
    return edition


@pytest.mark.slow
def test_joining_pools_no_slots_and_shortens_no_gap_and_leaving_resets_nothing(
    shipped: Edition, owner: User, stranger: User
) -> None:
    # The attack: two accounts send a file each on the same day, then one joins the other's team.
    for user, factor in ((owner, 1.1), (stranger, 1.2)):
        builders.submit(user, builders.predictions(shipped, factor=factor), visibility="PRIVATE")
    builders.score_all()
    alone = {user: state(user) for user in (owner, stranger)}
    assert [quota.left for quota in alone.values()] == [2, 2]
    latest = max(quota.next_slot_at for quota in alone.values() if quota.next_slot_at is not None)
    join(stranger, owner)
    assert set(Method.objects.values_list("team", flat=True)) == {teams.team_of(user=owner).pk}
    for user in (owner, stranger):
        together = state(user)
        assert (together.used, together.left, together.next_slot_at) == (2, 1, latest)
        with pytest.raises(QuotaExceeded, match="at least 24 hours apart"):
            builders.submit(user, builders.predictions(shipped, factor=1.3))
    # What the second brought along stays with the team, and what they sent stays with them.
    teams.leave(user=stranger)
    assert (state(owner).used, state(stranger).used) == (2, 1)
    assert (state(owner).next_slot_at, state(stranger).next_slot_at) == (latest, latest)
    join(stranger, owner)
    assert (state(owner).used, state(owner).next_slot_at) == (2, latest)


# --- one person, several accounts ---------------------------------------------------------------------------


@pytest.fixture
def proved(settings: Settings) -> None:
    """A site that proves addresses."""
    settings.ACCOUNT_EMAIL_VERIFICATION = "mandatory"


def account(email: str) -> User:
    return User.objects.create_user(email, "correct horse")


def test_an_address_is_folded_to_its_mailbox(db: None) -> None:
    folded = {
        "ada+2@example.org": "ada@example.org",
        "ADA+x+y@Example.org": "ada@example.org",
        "a.da@example.org": "a.da@example.org",
        "+ada@example.org": "+ada@example.org",
        '"a@b+c"@example.org': '"a@b+c"@example.org',
        "ada@exa+mple.org": "ada@exa+mple.org",
    }
    for email in folded:
        User.objects.create(email=email)
    assert dict(User.objects.values_list("email", "mailbox")) == folded


@pytest.mark.slow
@pytest.mark.usefixtures("proved")
def test_accounts_of_one_mailbox_spend_one_quota_whatever_teams_they_are_in(
    limited: Edition, owner: User, stranger: User
) -> None:
    second, third = account("owner+2@example.org"), account("Owner+ci@example.org")
    send(limited, owner, 1.1)
    send(limited, second, 1.2)
    assert [state(user).used for user in (owner, second, third, stranger)] == [2, 2, 2, 0]
    send(limited, third, 1.3)
    for user in (owner, second, third):
        with pytest.raises(QuotaExceeded):
            send(limited, user, 1.4)
    # Their teams know it as well, and nobody else's.
    join(third, stranger)
    assert (state(stranger).used, state(stranger).left) == (3, 0)


@pytest.mark.slow
def test_where_addresses_are_not_proved_nobody_spends_the_quota_of_another(
    limited: Edition, owner: User
) -> None:
    send(limited, account("owner+evil@example.org"), 1.1, 1.2, 1.3)
    assert state(owner).left == 3
