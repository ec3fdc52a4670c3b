"""Faults by mail: each once an hour, none hidden by another, and none that a visitor can cause."""

import logging
import logging.config
from collections.abc import Iterator

import pytest
import structlog
from django.db.models import QuerySet
from django.test import Client
from pytest_django import Settings

from leaderboard.models import Mail
from leaderboard.ops import logs
from leaderboard.web.landing import landing_views

pytestmark = pytest.mark.django_db


@pytest.fixture
def reports(settings: Settings) -> Iterator[QuerySet[Mail]]:
    """The mails about faults, with the logging of a site that sends them."""
    settings.ERROR_EMAILS = ["a@example.org"]
    logging.config.dictConfig(logs.logging_settings(as_json=True, level="INFO", has_reports=True))
    yield Mail.objects.filter(key__startswith="error:")
    logging.config.dictConfig(settings.LOGGING)


def test_a_request_with_a_wrong_host_sends_no_mail(reports: QuerySet[Mail], settings: Settings) -> None:
    settings.ALLOWED_HOSTS = ["board.example.org"]
    for host in ("scanner.example.com", "10.0.0.7", "bad_host"):
        assert Client(HTTP_HOST=host, raise_request_exception=False).get("/").status_code == 400
    assert not reports.exists()


def test_an_unhealthy_answer_hides_no_other_error(
    reports: QuerySet[Mail], monkeypatch: pytest.MonkeyPatch
) -> None:
    client = Client(raise_request_exception=False)
    for _ in range(3):
        assert client.get("/healthy").status_code == 503  # nobody has swept
    assert reports.count() == 1

    def fail(kind: type[Exception]) -> None:
        def act(*_: object, **__: object) -> None:
            raise kind("broken")

        monkeypatch.setattr(landing_views, "render", act)
        assert client.get("/").status_code == 500

    fail(ValueError)
    fail(ValueError)
    assert reports.count() == 2
    fail(KeyError)
    assert reports.count() == 3
    assert all(mail.text.count("Traceback") <= 1 for mail in reports)


def test_an_exception_is_one_fault_for_each_line_that_raises_it(
    reports: QuerySet[Mail],
) -> None:
    log = structlog.get_logger("leaderboard.test")

    def one() -> None:
        raise OSError("one")

    def other() -> None:
        raise OSError("other")

    for act in (one, one, other):
        try:
            act()
        except OSError:
            log.exception("failed")
    assert reports.count() == 2


def test_two_kinds_and_two_editions_are_three_faults(reports: QuerySet[Mail]) -> None:
    log = structlog.get_logger("leaderboard.test")
    for kind, subject, reason in (("a", "1", "x"), ("a", "1", "y"), ("a", "2", "x"), ("b", "1", "x")):
        log.error("backlog_failed", kind=kind, subject=subject, reason=reason)
    assert reports.count() == 3
