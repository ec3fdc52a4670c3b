"""An address that another account has not proved takes nothing from its owner."""

import subprocess
import sys
from datetime import timedelta

import pytest
from allauth.account.models import EmailAddress
from allauth.socialaccount.models import SocialAccount
from django.core import mail
from django.test import Client
from django.utils import timezone
from pytest_django import Settings

from leaderboard.models import User
from leaderboard.people import addresses
from tests.leaderboard.web.account.proving import (
    CONFIRM,
    PASSWORD,
    code_in,
    confirm,
    prove,
    proving,
    sign_up,
    signs_in,
)
from tests.leaderboard.web.test_every_page import assert_sound

VICTIM = "victim@example.org"
EVIL = "evil-password-77"


@pytest.fixture(autouse=True)
def _proving(db: None, settings: Settings) -> None:
    proving(settings)


@pytest.fixture
def attacker() -> Client:
    """A signed-in user with a proved address of their own."""
    client = Client()
    sign_up(client, "attacker@example.org", password=EVIL)
    assert prove(client).headers["Location"] == "/submit/"
    mail.outbox.clear()
    confirm(client, EVIL)
    return client


def subjects() -> list[str]:
    return [message.subject.partition("] ")[2] for message in mail.outbox]


@pytest.mark.slow
def test_with_a_mail_server_addresses_are_proved_by_a_code(production: dict[str, str]) -> None:
    code = (
        "from leaderboard import settings as s;"
        "print(s.ACCOUNT_EMAIL_VERIFICATION, s.ACCOUNT_EMAIL_VERIFICATION_BY_CODE_ENABLED)"
    )
    printed = subprocess.run(
        [sys.executable, "-c", code], env=production, capture_output=True, text=True, check=False
    )
    assert printed.stdout.split() == ["mandatory", "True"], printed.stderr


# --- an address that a user adds to their account ---------------------------------------------------------


@pytest.mark.slow
def test_an_address_that_another_account_added_is_free_for_its_owner(attacker: Client) -> None:
    added = attacker.post("/accounts/email/", {"action_add": "", "email": VICTIM})
    assert added.headers["Location"] == CONFIRM
    assert not EmailAddress.objects.filter(email=VICTIM).exists(), "nothing is kept before it is proved"
    [code_mail] = mail.outbox
    assert code_mail.to == [VICTIM]
    assert "account attacker@example.org" in code_mail.body
    page = assert_sound(attacker.get(CONFIRM)).one("main").text
    assert "belongs to the account attacker@example.org" in page

    victim = Client()
    assert sign_up(victim, VICTIM).headers["Location"] == CONFIRM
    assert subjects() == ["Confirm your email address"] * 2
    # The mails tell the two apart, and the attacker's code is worth nothing on the owner's page.
    assert "Someone signed up for" in mail.outbox[1].body
    assert "The code is wrong" in victim.post(CONFIRM, {"code": code_in(code_mail)}).text
    assert prove(victim).headers["Location"] == "/submit/"
    assert victim.get("/submissions/").status_code == 200
    assert signs_in(VICTIM, PASSWORD)
    assert not signs_in(VICTIM, EVIL)
    # Nor does the attacker's code prove it any more, should they learn it.
    assert attacker.post(CONFIRM, {"code": code_in(code_mail)}).status_code == 200
    assert EmailAddress.objects.get(email=VICTIM).user.email == VICTIM


# --- an account that a person signed up with it ----------------------------------------------------------


@pytest.mark.slow
def test_an_account_that_nobody_confirmed_gives_way_to_the_owners(attacker: Client) -> None:
    squatter = Client()
    taken = sign_up(squatter, VICTIM, password=EVIL, name="Evil")
    victim = Client()
    again = sign_up(victim, VICTIM)
    assert (taken.status_code, taken.headers["Location"]) == (again.status_code, again.headers["Location"])
    assert subjects() == ["Confirm your email address"] * 2
    assert prove(victim).headers["Location"] == "/submit/"
    assert signs_in(VICTIM, PASSWORD)
    assert not signs_in(VICTIM, EVIL)
    assert User.objects.get(email=VICTIM).name == ""
    # Neither code does anything for the one who came first.
    for message in mail.outbox:
        answer = squatter.post(CONFIRM, {"code": code_in(message)})
        assert answer.status_code in {200, 302}
    assert squatter.get("/submissions/").status_code == 302


@pytest.mark.slow
def test_who_is_displaced_before_proving_signs_up_once_more() -> None:
    victim = Client()
    sign_up(victim, VICTIM)
    sign_up(Client(), VICTIM, password=EVIL)
    own, _ = mail.outbox
    assert "The code is wrong" in victim.post(CONFIRM, {"code": code_in(own)}).text
    User.objects.filter(email=VICTIM).delete()
    assert "The code is wrong" in victim.post(CONFIRM, {"code": code_in(own)}).text
    victim.post("/accounts/logout/")  # the button "Cancel"
    sign_up(victim, VICTIM)
    assert prove(victim).headers["Location"] == "/submit/"
    assert signs_in(VICTIM, PASSWORD)


@pytest.mark.slow
def test_a_reset_password_opens_no_account_that_nobody_confirmed() -> None:
    """The person who made it may have another way in: an account elsewhere that is connected with it."""
    sign_up(Client(), VICTIM, password=EVIL)
    SocialAccount.objects.create(user=User.objects.get(email=VICTIM), provider="github", uid="666")
    Client().post("/accounts/password/reset/", {"email": VICTIM})
    assert subjects()[1] == "No account has this address"
    client = Client()
    sign_up(client, VICTIM)
    prove(client)
    assert not SocialAccount.objects.exists()


@pytest.mark.slow
def test_adding_an_address_that_another_signed_up_with_proves_it(attacker: Client) -> None:
    sign_up(Client(), VICTIM, password=EVIL)
    client = Client()
    sign_up(client, "owner@example.org")
    prove(client)
    confirm(client, PASSWORD)
    client.post("/accounts/email/", {"action_add": "", "email": VICTIM})
    assert prove(client).headers["Location"] == "/accounts/email/"
    assert not User.objects.filter(email=VICTIM).exists()
    assert signs_in(VICTIM, PASSWORD)


@pytest.mark.slow
def test_a_proved_address_stays_its_owners_and_the_answer_is_the_same() -> None:
    owner = Client()
    sign_up(owner, VICTIM)
    prove(owner)
    page = {}
    for email in (VICTIM, "free@example.org"):
        client = Client()
        assert sign_up(client, email, password=EVIL).headers["Location"] == CONFIRM
        main = assert_sound(client.get(CONFIRM)).one("main").text
        wrong = client.post(CONFIRM, {"code": "BBBB-BBBB"})
        page[email] = (main.replace(email, "…"), wrong.status_code)
    assert page[VICTIM] == page["free@example.org"]
    assert subjects()[1:] == ["You already have an account", "Confirm your email address"]
    assert signs_in(VICTIM, PASSWORD)
    assert User.objects.filter(email=VICTIM).count() == 1


# --- how long --------------------------------------------------------------------------------------------


def test_what_nobody_confirmed_is_deleted_after_a_day(attacker: Client, owner: User) -> None:
    sign_up(Client(), VICTIM, password=EVIL)
    now = timezone.now()
    addresses.delete_unproved(now=now + timedelta(hours=23))
    assert User.objects.filter(email=VICTIM).exists()
    addresses.delete_unproved(now=now + timedelta(hours=25))
    assert not User.objects.filter(email=VICTIM).exists()
    assert set(User.objects.values_list("email", flat=True)) == {"attacker@example.org", owner.email}


def test_without_a_mail_server_nothing_gives_way_or_ends(settings: Settings) -> None:
    settings.ACCOUNT_EMAIL_VERIFICATION_BY_CODE_ENABLED = False
    settings.ACCOUNT_EMAIL_VERIFICATION = "none"
    client = Client()
    sign_up(client, VICTIM)
    assert client.get("/submissions/").status_code == 200
    assert "already registered" in sign_up(Client(), VICTIM, password=EVIL).content.decode()
    addresses.delete_unproved(now=timezone.now() + timedelta(days=9))
    assert signs_in(VICTIM, PASSWORD)
