"""Whatever addresses a person has had, the files that were sent from one mailbox share one quota."""

import re
import uuid
from datetime import timedelta

import pytest
from allauth.account.models import EmailAddress
from django.core import mail
from django.db import connection
from django.db.migrations.executor import MigrationExecutor
from django.test import Client
from django.utils import timezone
from pytest_django.fixtures import Settings

from leaderboard.models import Edition, OldAddress, SpentMailbox, Split, Submission, User
from leaderboard.people import teams
from leaderboard.quotas import mailboxes, usage
from leaderboard.quotas.usage import QuotaExceeded
from leaderboard.upkeep import pollers
from tests import builders
from tests.leaderboard.quotas.test_mailboxes import account, forget, left, send
from tests.leaderboard.web.account import proving

DAY = timedelta(days=1)


@pytest.fixture
def shipped(edition: Edition, settings: Settings) -> Edition:
    """The test split with the rules that it has from the start, on a site that proves addresses."""
    Split.objects.filter(pk="test").update(quota_limit=3, quota_window=30 * DAY, quota_min_gap=DAY)
    proving.proving(settings)
    settings.ACCOUNT_RATE_LIMITS = {**settings.ACCOUNT_RATE_LIMITS, "signup": None, "mail": None}
    return edition


def person(email: str) -> tuple[Client, User]:
    """Sign up and prove the address, by the pages."""
    client = Client()
    proving.sign_up(client, email)
    proving.prove(client)
    client.post("/accounts/reauthenticate/", {"password": proving.PASSWORD})
    return client, User.objects.get(pk=client.session["_auth_user_id"])


def change_address(client: Client, *, old: str, new: str) -> None:
    """Add a proved address, make it the primary one and remove the other, by the pages."""
    client.post("/accounts/email/", {"action_add": "", "email": new})
    proving.prove(client)
    client.post("/accounts/email/", {"action_primary": "", "email": new})
    client.post("/accounts/email/", {"action_remove": "", "email": old})


# --- the two attacks ----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_ten_spellings_of_one_mailbox_send_one_file_a_day(shipped: Edition) -> None:
    n_sent = 0
    spellings = ["probe@example.org", *(f'"{"probe"[:i]}\\{"probe"[i:]}"@example.org' for i in range(5))]
    for i, email in enumerate(
        [*spellings, "PROBE@Example.org.", "probe+1@example.org", '"probe+2"@example.org']
    ):
        client = Client()
        proving.sign_up(client, email)
        if re.search("^[A-Z]{4}-[A-Z]{4}$", str(mail.outbox[-1].body), re.MULTILINE):
            proving.prove(client)
        if "_auth_user_id" not in client.session:
            continue
        user = User.objects.get(pk=client.session["_auth_user_id"])
        try:
            send(shipped, user, 1.1 + i / 10)
        except QuotaExceeded:
            continue
        n_sent += 1
    assert n_sent == 1
    assert User.objects.filter(email__contains='"').count() == 0


@pytest.mark.slow
def test_changing_the_address_frees_neither_the_old_one_nor_the_new_one(shipped: Edition) -> None:
    n_sent = 0
    for i in range(5):
        client, user = person("first@example.org")
        try:
            send(shipped, user, 1.1 + i / 10)
        except QuotaExceeded:
            pass
        else:
            n_sent += 1
        change_address(client, old="first@example.org", new=f"second+{i}@example.org")
        assert not EmailAddress.objects.filter(email="first@example.org").exists()
    assert n_sent == 1
    assert [left(user) for user in User.objects.order_by("pk")] == [2] * 5
    assert left(account("second+x@example.org")) == 2


@pytest.mark.slow
def test_every_proved_address_counts_not_the_primary_one_alone(shipped: Edition) -> None:
    first, second, third = (account(f"{name}@example.org") for name in ("a", "b+1", "c"))
    EmailAddress.objects.create(user=first, email="b@example.org", verified=True)
    EmailAddress.objects.create(user=first, email="c+1@example.org", verified=False)
    send(shipped, first, 1.1)
    assert [left(user) for user in (first, second, third)] == [2, 2, 3]
    with pytest.raises(QuotaExceeded):
        send(shipped, second, 1.2)
    send(shipped, third, 1.3)
    # The other way round as well: what the second sends counts for the first.
    Submission.objects.filter(submitted_by=first).update(submitted_at=timezone.now() - 40 * DAY)
    send(shipped, second, 1.4)
    assert [left(user) for user in (first, second, third)] == [2, 2, 2]


# --- until when, and for whom -------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_given_up_address_counts_until_the_window_ends_and_then_is_the_next_owners_alone(
    shipped: Edition,
) -> None:
    client, user = person("first@example.org")
    send(shipped, user, 1.1)
    change_address(client, old="first@example.org", new="second@example.org")
    _, heir = person("first@example.org")
    assert left(heir) == 2
    # What the former owner sends from now on is none of the heir's business.
    Submission.objects.update(submitted_at=timezone.now() - 2 * DAY)
    SpentMailbox.objects.update(sent_until=timezone.now() - 2 * DAY)
    user.refresh_from_db()
    send(shipped, user, 1.2)
    assert (left(user), left(heir)) == (1, 2)
    # And what the heir sends is none of the former owner's.
    send(shipped, heir, 1.3)
    assert (left(user), left(heir)) == (1, 1)
    later = timezone.now() + 31 * DAY
    pollers.clean(now=later)
    split = Split.objects.get(pk="test")
    quotas = [
        usage.state(team=teams.current_team_of(user=each), user=each, split=split, now=later)
        for each in (user, heir)
    ]
    assert [quota.left for quota in quotas] == [3, 3]
    assert not SpentMailbox.objects.exists()


@pytest.mark.slow
def test_an_address_that_is_proved_after_the_files_goes_on_counting_when_it_is_removed(
    shipped: Edition,
) -> None:
    client, user = person("first@example.org")
    send(shipped, user, 1.1)
    client.post("/accounts/email/", {"action_add": "", "email": "second@example.org"})
    proving.prove(client)
    client.post("/accounts/email/", {"action_remove": "", "email": "second@example.org"})
    assert left(account("second@example.org")) == 2


@pytest.mark.slow
def test_hashes_are_prolonged_with_each_file_and_deletion_finds_them_there(shipped: Edition) -> None:
    user = account("first@example.org")
    send(shipped, user, 1.1)
    Submission.objects.update(submitted_at=timezone.now() - 29 * DAY)
    SpentMailbox.objects.update(sent_until=timezone.now() - 29 * DAY, kept_until=timezone.now() + DAY)
    send(shipped, user, 1.2)
    row = SpentMailbox.objects.get()
    newest = Submission.objects.latest("submitted_at").submitted_at
    assert (row.sent_until, row.kept_until) == (newest, newest + 30 * DAY)
    forget(user)
    assert SpentMailbox.objects.get().kept_until == newest + 30 * DAY
    assert left(account("first+2@example.org")) == 1


def test_all_accounts_that_count_together_are_locked_together(shipped: Edition) -> None:
    first, second, third = (account(f"{name}@example.org") for name in ("a", "b+1", "c"))
    EmailAddress.objects.create(user=first, email="b@example.org", verified=True)
    for user in (first, second, third):
        mates = mailboxes.mates(User.objects.filter(pk=user.pk)).accounts
        assert set(mates) == ({first, second} if user != third else {third})


# --- accounts from before addresses had one spelling --------------------------------------------------------


@pytest.mark.slow
@pytest.mark.django_db(transaction=True)
def test_the_migration_gives_each_address_one_spelling_and_twins_share_a_mailbox(settings: Settings) -> None:
    proving.proving(settings)
    executor = MigrationExecutor(connection)
    graph = executor.loader.graph
    [migration] = [key for key in graph.nodes if key[1].endswith("_one_spelling_of_addresses")]
    before = [(parent[0], parent[1]) for parent in sorted(graph.node_map[migration].parents)]
    executor.migrate(before)
    try:
        old = executor.loader.project_state(before).apps
        user_table, address_table = (
            old.get_model("leaderboard", "User"),
            old.get_model("account", "EmailAddress"),
        )
        emails = [
            "probe@example.org",
            '"p\\robe"@example.org',
            "ada@b\u00fccher.example",
            '"lone"@example.org',
            '"tag+1"@example.org',
            '"two\\ words"@example.org',
            '"two\\ words+1"@example.org',
        ]
        password = User(email="x")
        password.set_password(proving.PASSWORD)
        for email in emails:
            user = user_table.objects.create(email=email, password=password.password)
            address_table.objects.create(user=user, email=email, verified=True, primary=True)
    finally:
        executor = MigrationExecutor(connection)
        executor.migrate(executor.loader.graph.leaf_nodes())
    stored = list(User.objects.order_by("pk").values_list("email", flat=True))
    assert stored == [
        "probe@example.org",
        '"p\\robe"@example.org',
        "ada@xn--bcher-kva.example",
        "lone@example.org",
        "tag+1@example.org",
        '"two words"@example.org',
        '"two words+1"@example.org',
    ]
    assert sorted(EmailAddress.objects.values_list("email", flat=True)) == sorted(stored)
    assert dict(OldAddress.objects.values_list("address", "mailbox")) == {
        '"p\\robe"@example.org': "probe@example.org",
        '"two words+1"@example.org': '"two words"@example.org',
    }
    # All of them sign in as ever.
    for email in emails:
        assert proving.signs_in(email, proving.PASSWORD), email
    users = dict(zip(emails, User.objects.order_by("pk"), strict=True))
    for first, second in (emails[:2], emails[5:]):
        for user in (users[first], users[second]):
            mates = mailboxes.mates(User.objects.filter(pk=user.pk)).accounts
            assert set(mates) == {users[first], users[second]}
    mail.outbox.clear()
    Client().post("/accounts/password/reset/", {"email": '"p\\robe"@example.org'})
    assert "/accounts/password/reset/key/" in str(mail.outbox[0].body)


def test_an_old_address_shares_its_quota_and_is_deleted_with_its_account(shipped: Edition) -> None:
    first = account("probe@example.org")
    second = User.objects.create(email='"p\\robe"@example.org')
    EmailAddress.objects.create(user=second, email=second.email, verified=True, primary=True)
    OldAddress.objects.create(address=second.email, mailbox="probe@example.org")
    send(shipped, second, 1.1)
    assert [left(user) for user in (first, second)] == [2, 2]
    with pytest.raises(QuotaExceeded):
        builders.submit(first, builders.predictions(shipped, factor=1.2), method=uuid.uuid4().hex)
    forget(second)
    assert not OldAddress.objects.exists()
    assert left(first) == 2


def test_maintainers_see_the_accounts_of_each_domain_and_the_addresses_of_one_mailbox(
    shipped: Edition, maintainer: User
) -> None:
    first, _second = account("a@owls.example"), account("b@owls.example")
    account("a@alone.example")
    OldAddress.objects.create(address='"p\\robe"@owls.example', mailbox="probe@owls.example")
    send(shipped, first, 1.1)
    client = Client()
    client.force_login(maintainer)
    page = client.get("/maintain/teams/").content.decode()
    table = page[page.index('id="domains"') :]
    cells = re.findall(r'<td class="(?:wraps|number)"[^>]*>([^<]+)</td>', table)
    assert [cell.strip() for cell in cells[:3]] == ["owls.example", "2", "1"]
    assert "alone.example" not in table
    assert "probe@owls.example" in table
