"""Accounts: what strangers can learn from, send in the name of, or do to those of others; and their pages."""

import re
from typing import Any, ClassVar

import pytest
from django.contrib.auth.hashers import MD5PasswordHasher
from django.core import mail
from django.test import Client
from pytest_django import Settings

from leaderboard.models import User
from tests.leaderboard.web.account.proving import code_in, proving

OLD_PASSWORD, PASSWORD = "correct horse", "kestrel-altimeter-9"
ATTACKER, HOME, ELSEWHERE = "203.0.113.9", "198.51.100.7", "192.0.2.3"


def sign_in(user: User, password: str, *, address: str) -> bool:
    """Whether this password, sent from this address, opens the account."""
    form = {"login": user.email, "password": password}
    return Client().post("/accounts/login/", form, REMOTE_ADDR=address).status_code == 302


# --- who is locked out -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_wrong_passwords_from_one_address_lock_out_that_address_and_not_the_owner(owner: User) -> None:
    assert not any(sign_in(owner, "wrong", address=ATTACKER) for _ in range(12))
    assert not sign_in(owner, OLD_PASSWORD, address=ATTACKER)
    assert sign_in(owner, OLD_PASSWORD, address=ELSEWHERE)
    assert sign_in(owner, OLD_PASSWORD, address=ELSEWHERE)


def test_the_host_that_a_request_names_begins_no_new_count(owner: User) -> None:
    form = {"login": owner.email, "password": "wrong"}
    for host in ("a.example", "b.example", "c.example", "d.example", "e.example"):
        Client().post("/accounts/login/", form, REMOTE_ADDR=ATTACKER, HTTP_HOST=host)
    assert not sign_in(owner, OLD_PASSWORD, address=ATTACKER)


@pytest.mark.slow
def test_guesses_from_many_addresses_meet_the_limit_of_the_account(owner: User) -> None:
    assert sign_in(owner, OLD_PASSWORD, address=HOME)
    for n in range(30):
        sign_in(owner, "wrong", address=f"203.0.113.{n}")
    # Also the right password, from an address that the account has never signed in from.
    assert not sign_in(owner, OLD_PASSWORD, address=ELSEWHERE)
    # The owner's own address is known, and goes on being good.
    assert sign_in(owner, OLD_PASSWORD, address=HOME)


@pytest.mark.slow
def test_a_reset_password_opens_the_account_from_everywhere(owner: User) -> None:
    for n in range(30):
        sign_in(owner, "wrong", address=f"203.0.113.{n}")
    client = Client()
    client.post("/accounts/password/reset/", {"email": owner.email})
    form = client.get(link_in(mail.outbox[-1], "/accounts/password/reset/key/"), follow=True)
    passwords = {"password1": PASSWORD, "password2": PASSWORD}
    client.post(form.redirect_chain[-1][0], passwords)
    assert sign_in(owner, PASSWORD, address=ELSEWHERE)


# --- what mails say --------------------------------------------------------------------------------------


def link_in(message: Any, path: str) -> str:
    match = re.search(rf"http://127\.0\.0\.1:8000({path}\S*)", str(message.body))
    assert match is not None, message.body
    return match.group(1)


def test_mailed_links_lead_to_the_configured_site_whatever_host_is_asked(
    owner: User, settings: Settings
) -> None:
    proving(settings)
    evil = Client(HTTP_HOST="evil.example")
    evil.post("/accounts/password/reset/", {"email": owner.email})
    evil.post("/accounts/password/reset/", {"email": "nobody@example.org"})
    form = {"email": "new@example.org", "password1": PASSWORD, "password2": PASSWORD, "name": ""}
    evil.post("/accounts/signup/", form)
    assert len(mail.outbox) == 3
    for message in mail.outbox:
        assert "evil.example" not in f"{message.subject} {message.body}"
    link_in(mail.outbox[0], "/accounts/password/reset/key/")
    link_in(mail.outbox[1], "/accounts/signup/")
    assert code_in(mail.outbox[2])


# --- whether an address has an account -------------------------------------------------------------------


class CountingHasher(MD5PasswordHasher):
    """Counts how often a password is hashed."""

    n_hashed: ClassVar[int] = 0

    def encode(self, password: str, salt: str) -> str:
        """The hash, counted."""
        type(self).n_hashed += 1
        return str(super().encode(password, salt))


def test_sign_up_with_a_taken_address_answers_and_works_as_with_a_free_one(
    owner: User, settings: Settings
) -> None:
    proving(settings)
    settings.PASSWORD_HASHERS = [f"{__name__}.CountingHasher"]
    answers = []
    for email in (owner.email, "free@example.org"):
        CountingHasher.n_hashed = 0
        form = {"email": email, "password1": PASSWORD, "password2": PASSWORD, "name": ""}
        response = Client().post("/accounts/signup/", form)
        answers.append((response.status_code, response.headers["Location"], CountingHasher.n_hashed))
    taken, free = answers
    assert taken == free
    assert taken[2] == 1
    assert [message.to for message in mail.outbox] == [[owner.email], ["free@example.org"]]
