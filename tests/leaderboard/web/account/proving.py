"""The site as it is with a mail server: an address counts once a mailed code has proved it."""

import re
from typing import Any

from django.core import mail
from django.test import Client
from pytest_django import Settings

PASSWORD = "kestrel-altimeter-9"
CONFIRM = "/accounts/confirm-email/"


def proving(settings: Settings) -> None:
    """Set what `TSTTC_EMAIL_URL` sets."""
    settings.ACCOUNT_EMAIL_VERIFICATION = "mandatory"
    settings.ACCOUNT_EMAIL_VERIFICATION_BY_CODE_ENABLED = True
    # One mail in ten seconds to one address; no test waits.
    settings.ACCOUNT_RATE_LIMITS = {**settings.ACCOUNT_RATE_LIMITS, "confirm_email": None}


def code_in(message: Any) -> str:
    """The code that a mail names."""
    [code] = re.findall(r"^[A-Z]{4}-[A-Z]{4}$", str(message.body), re.MULTILINE)
    return str(code)


def sign_up(client: Client, email: str, *, password: str = PASSWORD, name: str = "") -> Any:
    """Send the form."""
    form = {"email": email, "password1": password, "password2": password, "name": name}
    return client.post("/accounts/signup/", form)


def prove(client: Client) -> Any:
    """Enter the code of the last mail."""
    return client.post(CONFIRM, {"code": code_in(mail.outbox[-1])})


def signs_in(email: str, password: str) -> bool:
    """Whether this opens an account."""
    client = Client()
    client.post("/accounts/login/", {"login": email, "password": password})
    return client.get("/submissions/").status_code == 200


def confirm(client: Client, password: str = "correct horse") -> None:
    """Confirm with the password who acts, as before everything that may take an account over."""
    answer = client.post("/accounts/reauthenticate/", {"password": password, "next": "/account/"})
    assert answer.headers["Location"] == "/account/"
