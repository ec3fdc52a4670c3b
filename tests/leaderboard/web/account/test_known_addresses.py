"""No page tells whether an address has an account: the same bytes for a free and for a taken one."""

import re
from typing import Any

import pytest
from allauth.account.models import EmailAddress
from django.core import mail
from django.test import Client
from pytest_django import Settings

from leaderboard.mails import outbox
from leaderboard.models import Mail, User
from tests.leaderboard.web.account.proving import (
    CONFIRM,
    PASSWORD,
    confirm,
    prove,
    proving,
    sign_up,
    signs_in,
)

TAKEN, FREE = "taken@example.org", "free@example.org"
EVIL = "evil-password-77"
SIGN_IN = "/accounts/login/"


@pytest.fixture(autouse=True)
def _proving(db: None, settings: Settings) -> None:
    proving(settings)
    sign_up(client := Client(), TAKEN)
    prove(client)
    mail.outbox.clear()


def answers(email: str, *steps: tuple[str, dict[str, str] | None]) -> list[Any]:
    """What one browser is answered, step by step, with the address and the tokens of forms taken out."""
    client, seen = Client(REMOTE_ADDR=f"192.0.2.{len(email)}"), []
    for path, fields in steps:
        sent = {name: value.replace("EMAIL", email) for name, value in (fields or {}).items()}
        answer = client.get(path) if fields is None else client.post(path, sent)
        body = answer.text.replace(email, "EMAIL")
        body = re.sub(r'(name="csrfmiddlewaretoken" value=|nonce=)"[^"]*"', r"\1", body)
        cookies = sorted((name, morsel["max-age"]) for name, morsel in answer.cookies.items())
        seen.append((path, answer.status_code, answer.headers.get("Location"), cookies, body))
    return seen


SIGNING_UP = ("/accounts/signup/", {"email": "EMAIL", "password1": EVIL, "password2": EVIL, "name": "x"})
SIGNING_IN = (SIGN_IN, {"login": "EMAIL", "password": EVIL})
WRONG = (CONFIRM, {"code": "BBBB-BBBB"})
WAYS: dict[str, list[tuple[str, dict[str, str] | None]]] = {
    "sign-up, page, resend, wrong codes": [
        SIGNING_UP,
        (CONFIRM, None),
        (CONFIRM, {"action": "resend"}),
        *[WRONG] * 4,
        (CONFIRM, None),
    ],
    "sign-up and sign-in in one browser": [SIGNING_UP, SIGNING_IN, (SIGN_IN, None), (CONFIRM, None)],
    "change on the page": [SIGNING_UP, (CONFIRM, {"action": "change", "email": "x@example.org"})],
    "sign-up twice": [SIGNING_UP, SIGNING_UP, (CONFIRM, None)],
    "sign-up, sign-out, sign-in": [SIGNING_UP, ("/accounts/logout/", {}), SIGNING_IN, (CONFIRM, None)],
    "reset": [("/accounts/password/reset/", {"email": "EMAIL"}), ("/accounts/password/reset/done/", None)],
    "sign-in": [SIGNING_IN, (CONFIRM, None), (SIGN_IN, None)],
}


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_every_way_answers_the_same_for_a_free_and_a_taken_address(way: str) -> None:
    assert answers(TAKEN, *WAYS[way]) == answers(FREE, *WAYS[way])


@pytest.mark.slow
def test_signing_in_after_signing_up_answers_as_a_wrong_password_does() -> None:
    for email in (TAKEN, FREE):
        sign_up(Client(), email, password=EVIL)
    asked = [SIGNING_IN, (CONFIRM, None), SIGNING_IN, *[SIGNING_IN] * 6]
    # Also how many tries there are is the same.
    assert answers(TAKEN, *asked) == answers(FREE, *asked)
    assert not signs_in(FREE, EVIL)
    # The owner of the address is told what to do, once.
    [reminder] = Mail.objects.filter(ended_at=None)
    assert reminder.recipient == FREE
    assert "/accounts/signup/" in reminder.text
    assert outbox.waiting() == 1


def test_an_account_that_is_in_use_still_proves_its_address_at_the_sign_in(owner: User) -> None:
    EmailAddress.objects.create(user=owner, email=owner.email, primary=True, verified=False)
    owner.last_login = owner.date_joined
    owner.save()
    client = Client()
    led = client.post(SIGN_IN, {"login": owner.email, "password": "correct horse"})
    assert led.headers["Location"] == CONFIRM
    assert prove(client).status_code == 302
    assert client.get("/submissions/").status_code == 200


@pytest.mark.slow
def test_adding_a_free_and_a_taken_address_answers_the_same() -> None:
    seen = []
    for number, email in enumerate((TAKEN, FREE)):
        client = Client()
        sign_up(client, f"{number}@example.org")
        prove(client)
        confirm(client, PASSWORD)
        added = client.post("/accounts/email/", {"action_add": "", "email": email})
        page = client.get(CONFIRM).text.replace(email, "EMAIL").replace(f"{number}@example.org", "OWN")
        seen.append((added.status_code, added.headers["Location"], re.sub(r'value="[^"]*"', "", page)))
    assert seen[0] == seen[1]


@pytest.mark.slow
def test_a_right_password_may_be_sent_only_so_often(owner: User) -> None:
    EmailAddress.objects.create(user=owner, email=owner.email, primary=True, verified=True)
    fields = {"login": owner.email, "password": "correct horse"}
    statuses = [Client(REMOTE_ADDR="192.0.2.1").post(SIGN_IN, fields).status_code for _ in range(25)]
    assert statuses[:19] == [302] * 19
    assert statuses[-1] != 302
    # Nobody else is kept out by it: the owner comes from another address.
    assert Client(REMOTE_ADDR="192.0.2.2").post(SIGN_IN, fields).status_code == 302
