"""A mailbox has many addresses; an account has one spelling of one, and the quota follows the mailbox."""

from io import StringIO

import pytest
from allauth.account.models import EmailAddress
from django.core import mail
from django.core.management import CommandError, call_command
from django.test import Client
from pytest_django.fixtures import Settings

from leaderboard.errors.refusals import Refused
from leaderboard.models import User
from leaderboard.models.addresses import mailbox_of, spelled
from leaderboard.people import addresses
from tests.leaderboard.web.account import proving

OWN = "probe@example.org"
# All that these are is another way to write the mailbox `OWN`, or nothing that a mail server delivers.
SPELLINGS = [
    '"probe"@example.org',
    '"p\\robe"@example.org',
    '"\\p\\r\\o\\b\\e"@example.org',
    '"PROBE"@example.org',
    '"probe+1"@example.org',
    '"probe\\+1"@example.org',
    "probe+1@example.org",
    "probe+@example.org",
    "probe++@example.org",
    "Probe+a.b@EXAMPLE.org",
    "PROBE@example.org",
    "probe@Example.ORG",
    " probe@example.org\t",
    "\u00a0probe@example.org\u3000",
    "probe@example.org.",
    "probe@example\u3002org",
    "probe@example\uff0eorg",
    "probe@example\uff61org",
    "probe@ex\u00adample.org",
    "probe@ex\u200bample.org",
    "probe@ex\u2060ample.org",
    "probe@ex\ufe0fample.org",
    "probe@\uff45xample.org",
    "probe@\U0001d41example.org",
    "probe@\u24d4xample.org",
    "probe@EX\u212bMPLE.org".replace("\u212b", "A"),
    "prob\uff45@example.org",
    "\uff30\uff32\uff2f\uff22\uff25@example.org",
    "probe\uff20example.org",
    "\u24dfrobe@example.org",
    "pro\u200bbe@example.org",
    "pro\u00adbe@example.org",
    "probe(a comment)@example.org",
    "(a comment)probe@example.org",
    "probe@(a comment)example.org",
    "probe @example.org",
    "probe@ example.org",
    "<probe@example.org>",
    "Probe <probe@example.org>",
    "mailto:probe@example.org",
    "probe%example.org@example.org",
    "example.org!probe@example.org",
    "@relay.example:probe@example.org",
    '"probe%example.org"@example.org',
    "probe@[93.184.216.34]",
    "probe@[IPv6:2001:db8::1]",
    "probe@example.org\n",
    "probe@example.org\r\nBcc: x@example.org",
    "probe@example.org,x@example.org",
    "probe@example.org;",
    ".probe@example.org",
    "probe.@example.org",
]


@pytest.mark.parametrize("spelling", SPELLINGS, ids=ascii)
def test_another_spelling_of_a_mailbox_is_refused_or_counts_as_the_same_mailbox(spelling: str) -> None:
    try:
        address = addresses.accepted(spelling)
    except Refused:
        return
    assert (mailbox_of(address), spelled(address)) == (OWN, address)


def test_a_domain_in_any_script_has_one_spelling() -> None:
    forms = [
        "ada@b\u00fccher.example",
        "ada@BU\u0308CHER.example",
        "ada@xn--bcher-kva.example",
        "ada@XN--BCHER-KVA.Example.",
    ]
    assert {addresses.accepted(form) for form in forms} == {"ada@xn--bcher-kva.example"}
    # A sharp s is a letter of its own in domains; it is where mails go, too.
    assert addresses.accepted("ada@fa\u00df.example") == "ada@xn--fa-hia.example"


def test_other_mailboxes_stay_other_mailboxes() -> None:
    others = [
        "pr.obe@example.org",
        "probe@mail.example.org",
        "probe-1@example.org",
        "+probe@example.org",
        "probe@example.com",
    ]
    for address in others:
        assert mailbox_of(addresses.accepted(address)) == address


@pytest.mark.django_db
def test_the_database_and_python_agree_on_the_mailbox_of_each_accepted_address() -> None:
    accepted = set()
    for spelling in [*SPELLINGS, "a.da+x@b\u00fccher.example", "+ada@example.org", "ada@ex+ample.org"]:
        try:
            accepted.add(addresses.accepted(spelling))
        except Refused:
            continue
    User.objects.bulk_create(User(email=address) for address in accepted)
    assert len(accepted) > 5
    for address, mailbox in User.objects.values_list("email", "mailbox"):
        assert mailbox == mailbox_of(address)


# --- the doors ----------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.django_db
def test_sign_up_makes_one_account_of_all_spellings(settings: Settings) -> None:
    proving.proving(settings)
    settings.ACCOUNT_RATE_LIMITS = {**settings.ACCOUNT_RATE_LIMITS, "signup": None, "mail": None}
    for spelling in SPELLINGS:
        proving.sign_up(Client(), spelling)
    assert {mailbox_of(user.email) for user in User.objects.all()} == {OWN}
    assert all(user.email == spelled(user.email) for user in User.objects.all())
    assert not User.objects.exclude(email__regex=r"^probe(\+[a-z0-9.+]*)?@example\.org$").exists()


@pytest.mark.slow
@pytest.mark.django_db
def test_who_signed_up_in_one_spelling_signs_in_and_resets_the_password_in_another(
    settings: Settings,
) -> None:
    proving.proving(settings)
    client = Client()
    proving.sign_up(client, "Ada@B\u00fccher.example")
    assert mail.outbox[-1].to == ["ada@xn--bcher-kva.example"]
    proving.prove(client)
    for spelling in ("ada@b\u00fccher.example", "ADA@xn--bcher-kva.example", '"a\\da"@b\u00fccher.example'):
        assert proving.signs_in(spelling, proving.PASSWORD), spelling
    mail.outbox.clear()
    Client().post("/accounts/password/reset/", {"email": "ada@b\u00fccher.example"})
    assert [message.to for message in mail.outbox] == [["ada@xn--bcher-kva.example"]]
    assert "/accounts/password/reset/key/" in str(mail.outbox[0].body)


@pytest.mark.django_db
def test_an_added_address_has_the_one_spelling_or_is_refused(settings: Settings) -> None:
    proving.proving(settings)
    client = Client()
    proving.sign_up(client, OWN)
    proving.prove(client)
    client.post("/accounts/reauthenticate/", {"password": proving.PASSWORD})
    refused = client.post("/accounts/email/", {"action_add": "", "email": '"o\\ ther"@example.org'})
    assert "expected an address without quotes" in refused.content.decode()
    client.post("/accounts/email/", {"action_add": "", "email": "Ada@B\u00fccher.example"})
    proving.prove(client)
    assert set(EmailAddress.objects.values_list("email", flat=True)) == {OWN, "ada@xn--bcher-kva.example"}


@pytest.mark.slow
@pytest.mark.django_db
def test_mails_that_anybody_can_ask_for_are_limited_for_the_mailbox(settings: Settings) -> None:
    proving.proving(settings)
    settings.ACCOUNT_RATE_LIMITS = {**settings.ACCOUNT_RATE_LIMITS, "reset_password": None, "signup": None}
    answers = [
        Client().post("/accounts/password/reset/", {"email": f"probe+{i}@example.org"}) for i in range(6)
    ] + [proving.sign_up(Client(), f"probe+{i}@example.org") for i in range(6)]
    assert len(mail.outbox) == 5
    assert "Try again in a minute" in answers[-1].content.decode()
    assert "Try again in a minute" in answers[5].content.decode()
    Client().post("/accounts/password/reset/", {"email": "another@example.org"})
    assert len(mail.outbox) == 6


@pytest.mark.django_db
def test_commands_find_and_make_accounts_by_the_one_spelling() -> None:
    user = User.objects.create_user("Ada@B\u00fccher.example")
    assert user.email == "ada@xn--bcher-kva.example"
    call_command("set_maintainer", '"ADA"@b\u00fccher.example', "--reason", "R", stdout=StringIO())
    user.refresh_from_db()
    assert user.is_staff
    call_command(
        "create_token", "ada@b\u00fccher.example", "--name", "N", stdout=StringIO(), stderr=StringIO()
    )
    assert User.objects.count() == 1
    for command in (
        ("create_token", '"x y"@example.org', "--name", "N"),
        ("createsuperuser", "--no-input", "--email", "x@[127.0.0.1]"),
    ):
        with pytest.raises(CommandError, match="expected"):
            call_command(*command, stdout=StringIO(), stderr=StringIO())
    with pytest.raises(CommandError, match="Another account has this address"):
        call_command(
            "createsuperuser", "--no-input", "--email", '"ada"@b\u00fccher.example', stdout=StringIO()
        )
    assert User.objects.count() == 1
