"""A mail says which service failed, without a database."""

import pytest
from django.core import mail
from django.core.management import CommandError, call_command
from pytest_django import Settings

NAME = "tsttc-backup.service"


def test_everybody_of_the_setting_gets_a_mail_that_names_the_service(settings: Settings) -> None:
    settings.ERROR_EMAILS = ["one@example.org", "two@example.org"]
    call_command("report_failure", NAME)
    [sent] = mail.outbox
    assert sent.to == settings.ERROR_EMAILS
    assert f"{NAME} failed" in sent.subject
    assert f"journalctl --unit {NAME}" in sent.body


def test_without_an_address_or_a_mail_server_the_command_fails(settings: Settings) -> None:
    with pytest.raises(CommandError, match="TSTTC_ERROR_EMAILS names nobody"):
        call_command("report_failure", NAME)
    settings.ERROR_EMAILS = ["one@example.org"]
    settings.EMAIL_BACKEND = "django.core.mail.backends.smtp.EmailBackend"
    settings.EMAIL_HOST, settings.EMAIL_PORT = "127.0.0.1", 1
    with pytest.raises(CommandError, match=r"nobody could be told: .*refused"):
        call_command("report_failure", NAME)
