"""`check --deploy` and the mail server: it connects and signs in, and sends nothing."""

from collections.abc import Iterator

import pytest
from pytest_django import Settings

from leaderboard.ops import deployment, environment
from tests.leaderboard.mails import smtp_server


@pytest.fixture
def server(settings: Settings, monkeypatch: pytest.MonkeyPatch) -> Iterator[smtp_server.Server]:
    monkeypatch.setattr(environment, "PRODUCTION", True)
    monkeypatch.setattr(environment, "PROCESS", "mailer")
    with smtp_server.running() as running:
        settings.SENDS_MAIL = True
        settings.EMAIL_BACKEND = "django.core.mail.backends.smtp.EmailBackend"
        settings.EMAIL_HOST, settings.EMAIL_PORT = "127.0.0.1", running.port
        settings.EMAIL_USE_TLS, settings.EMAIL_USE_SSL = False, False
        settings.EMAIL_HOST_USER = settings.EMAIL_HOST_PASSWORD = ""
        yield running


def complaints() -> list[str]:
    """What the check says of the mail server."""
    return [str(each.msg) for each in deployment.check_services() if "mail server" in str(each.msg)]


def test_a_mail_server_that_answers_is_no_complaint_and_gets_no_mail(
    server: smtp_server.Server, db: None
) -> None:
    assert complaints() == []
    assert server.taken == server.asked == []


@pytest.mark.parametrize("wrong", ["nobody there", "no encryption", "no sign-in", "plain port"])
def test_a_mail_server_that_lets_nobody_in_is_a_complaint_without_password(
    server: smtp_server.Server, settings: Settings, wrong: str, db: None
) -> None:
    settings.EMAIL_TIMEOUT = 2
    if wrong == "nobody there":
        settings.EMAIL_PORT = 1
    elif wrong == "no encryption":
        settings.EMAIL_USE_TLS = True
    elif wrong == "plain port":
        settings.EMAIL_USE_SSL = True
    else:
        settings.EMAIL_HOST_USER, settings.EMAIL_HOST_PASSWORD = "site", "swordfish"
    [complaint] = complaints()
    assert "does not let the site in" in complaint
    assert "no code for signing in arrives" in complaint
    assert "swordfish" not in complaint


def test_a_site_without_https_is_a_complaint(settings: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environment, "PRODUCTION", True)
    settings.SITE_URL = "http://board.example.org"
    assert any("expected https" in str(each.msg) for each in deployment.check_variables())
