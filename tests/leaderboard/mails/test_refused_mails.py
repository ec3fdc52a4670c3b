"""A refused recipient concerns one mail: all others are sent, and maintainers see which were not."""

from collections.abc import Iterator
from datetime import timedelta

import pytest
from django.core.mail import EmailMessage
from django.test import Client
from django.utils import timezone
from pytest_django import Settings

from leaderboard.mails import outbox
from leaderboard.models import Mail, MailKind, User
from leaderboard.ops import health
from tests.leaderboard.mails import smtp_server
from tests.leaderboard.ops.test_prometheus import figures

pytestmark = pytest.mark.django_db

NOW = timezone.now()
MINUTE, DAY = timedelta(minutes=1), timedelta(days=1)


@pytest.fixture
def server(settings: Settings) -> Iterator[smtp_server.Server]:
    with smtp_server.running() as running:
        settings.EMAIL_BACKEND = "django.core.mail.backends.smtp.EmailBackend"
        settings.EMAIL_HOST, settings.EMAIL_PORT = "127.0.0.1", running.port
        settings.EMAIL_USE_TLS, settings.EMAIL_USE_SSL = False, False
        settings.EMAIL_HOST_USER = settings.EMAIL_HOST_PASSWORD = ""
        yield running


def queue(*recipients: str) -> None:
    """Queue one mail for each, in this order."""
    outbox.queue(
        [
            Mail(
                kind=MailKind.ACCOUNT,
                recipient=recipient,
                subject="S",
                text="secret link",
                queued_at=NOW - MINUTE,
                due_at=NOW - MINUTE + timedelta(milliseconds=number),
            )
            for number, recipient in enumerate(recipients)
        ]
    )


def state_of(recipient: str) -> tuple[bool, str, str]:
    """Whether a mail has ended, its text, and the reason."""
    row = Mail.objects.get(recipient=recipient)
    return row.ended_at is not None, row.text, row.reason


def state_of_all(recipient: str) -> list[tuple[bool, str, str]]:
    """`state_of` for each mail to somebody."""
    rows = Mail.objects.filter(recipient=recipient)
    return [(row.ended_at is not None, row.text, row.reason) for row in rows]


@pytest.mark.slow
@pytest.mark.parametrize("dead", ["gone@example.org", "a b\n@example.org", "ä" * 70 + "@exa..mple", ""])
def test_refused_recipients_end_their_mails_and_delay_no_other(server: smtp_server.Server, dead: str) -> None:
    queue(*[dead] * 60, "first@example.org", "second@example.org")
    # Even so many cannot fill more than one run.
    assert sum(outbox.work_off(now=NOW) for _ in range(2)) == 2
    assert server.taken == ["first@example.org", "second@example.org"]
    assert outbox.waiting() == 0
    for mail in outbox.unsent():
        assert (mail.recipient, mail.subject, mail.text, mail.n_tries) == (dead, "", "", 1)
        assert mail.reason
    assert outbox.unsent().count() == 60


@pytest.mark.parametrize(
    ("slow", "answer"),
    [("full@example.org", "452 4.2.2 Mailbox full"), ("later@x.org", "451 4.7.1 Greylisted")],
)
def test_a_mail_that_is_put_off_waits_alone_and_ends_after_three_days(
    server: smtp_server.Server, slow: str, answer: str
) -> None:
    queue(slow, "first@example.org", "second@example.org")
    assert outbox.work_off(now=NOW) == 2
    assert state_of(slow) == (False, "secret link", answer)
    assert outbox.work_off(now=NOW) == 0
    assert server.asked.count(slow) == 1  # not tried again at once
    for hours in range(1, 80):
        outbox.work_off(now=NOW + timedelta(hours=hours))
    assert state_of(slow) == (True, "", answer)
    assert server.asked.count(slow) > 60


@pytest.mark.parametrize("breaker", ["crash@example.org", "busy@example.org"])
def test_a_mail_at_which_the_server_breaks_off_does_not_stop_the_run(
    server: smtp_server.Server, breaker: str
) -> None:
    queue(breaker, breaker, "first@example.org", "second@example.org")
    assert outbox.work_off(now=NOW) == 2
    assert outbox.waiting() == 2


OF_THE_SERVER = [
    "554 5.7.1 <first@example.org>: Relay access denied",
    "553 5.7.1 <site@example.org>: Sender address rejected: not owned by user",
    "550 5.7.60 Client does not have permissions to send as this sender",
    "550 5.1.8 <site@example.org>: Sender address rejected: Domain not found",
    "550 relay not permitted",
    "530 5.7.0 Authentication required",
    "554 5.7.0 Authentication required",
]


@pytest.mark.slow
@pytest.mark.parametrize("answer", OF_THE_SERVER)
@pytest.mark.parametrize("step", ["recipient_answer", "text_answer"])
def test_a_refusal_of_every_mail_ends_none_and_is_shown_until_the_server_takes_one(
    server: smtp_server.Server, settings: Settings, client: Client, maintainer: User, answer: str, step: str
) -> None:
    settings.SENDS_MAIL = True
    queue("first@example.org", "second@example.org")
    setattr(server, step, answer)
    for tries in range(4):
        assert outbox.work_off(now=NOW + tries * 20 * MINUTE) == 0
    assert outbox.waiting() == 2
    assert outbox.unsent().count() == 0
    assert health.mails_wait(now=NOW + 70 * MINUTE)
    assert figures()['tsttc_faults_total{kind="mail server"}'] == 4
    client.force_login(maintainer)
    page = client.get("/maintain/").text
    assert "the mail server takes none, 4 times" in page
    assert answer[:9] in page
    assert "first@example.org" not in page
    setattr(server, step, "")
    assert outbox.work_off(now=NOW + 3 * 60 * MINUTE) == 2
    assert not health.mails_wait(now=NOW + 3 * 60 * MINUTE)
    assert "takes none" not in client.get("/maintain/").text


@pytest.mark.parametrize(
    ("answer", "is_of_the_server"),
    [
        ("450 4.7.1 Client host rejected: cannot find your hostname", True),
        ("451 4.3.5 Server configuration error", True),
        ("451 Try again later", True),
        ("452 4.2.2 Mailbox full", False),
        ("450 4.1.1 Mailbox unavailable", False),
    ],
)
def test_a_server_that_puts_two_mails_off_for_a_reason_of_its_own_is_named(
    server: smtp_server.Server, settings: Settings, answer: str, is_of_the_server: bool
) -> None:
    settings.SENDS_MAIL = True
    queue("first@example.org", "second@example.org")
    server.recipient_answer = answer
    for tries in range(4):
        outbox.work_off(now=NOW + tries * 20 * MINUTE)
    assert outbox.waiting() == 2
    assert health.mails_wait(now=NOW + 70 * MINUTE) is is_of_the_server


def test_a_refusal_that_may_be_of_all_ends_two_mails_once_another_is_taken(
    server: smtp_server.Server,
) -> None:
    spam = ["spam@example.org", "spam@other.example.org"]
    queue(*spam)
    assert outbox.work_off(now=NOW) == 0
    assert outbox.waiting() == 2
    queue("first@example.org")
    assert outbox.work_off(now=NOW + MINUTE) == 1
    assert {mail.recipient: mail.reason for mail in outbox.unsent()} == dict.fromkeys(
        spam, "554 5.7.1 Not wanted"
    )
    assert outbox.waiting() == 0


@pytest.mark.slow
def test_one_recipient_whose_refusal_may_be_of_all_is_no_fault_of_the_server(
    server: smtp_server.Server, settings: Settings
) -> None:
    settings.SENDS_MAIL = True
    queue("spam@example.org", "spam@example.org")
    for tries in range(4):
        outbox.work_off(now=NOW + tries * 20 * MINUTE)
    assert not health.mails_wait(now=NOW + 70 * MINUTE)
    assert outbox.put_off().count() == 2
    for hours in range(2, 80):
        outbox.work_off(now=NOW + timedelta(hours=hours))
    assert state_of_all("spam@example.org") == [(True, "", "554 5.7.1 Not wanted")] * 2


def test_a_mail_that_is_refused_as_all_during_a_request_is_kept(server: smtp_server.Server) -> None:
    server.recipient_answer = OF_THE_SERVER[0]
    for recipient in ("first@example.org", "second@example.org"):
        outbox.send_or_keep(message=EmailMessage("S", "secret link", to=[recipient]), now=NOW)
    assert outbox.waiting() == 2
    server.recipient_answer = ""
    assert outbox.work_off(now=NOW + MINUTE) == 2


def test_a_server_that_is_away_is_named_with_its_reason(settings: Settings, keeper: Client) -> None:
    settings.SENDS_MAIL = True
    settings.EMAIL_BACKEND = "django.core.mail.backends.smtp.EmailBackend"
    settings.EMAIL_HOST, settings.EMAIL_PORT = "127.0.0.1", 1
    queue("first@example.org", "second@example.org")
    assert outbox.work_off(now=NOW) == 0
    assert "ConnectionRefusedError" in keeper.get("/maintain/").text


def test_a_server_that_refuses_the_sender_loses_no_mail(server: smtp_server.Server) -> None:
    queue("first@example.org", "second@example.org")
    server.sender_answer = "553 5.7.1 Not your address"
    assert outbox.work_off(now=NOW) == 0
    assert outbox.waiting() == 2
    server.sender_answer = "250 ok"
    assert outbox.work_off(now=NOW + MINUTE) == 2


def test_a_server_that_wants_a_log_in_loses_no_mail(server: smtp_server.Server) -> None:
    queue(*[f"{number}@example.org" for number in range(10)])
    server.sender_answer = "530 5.7.0 Authentication required"
    assert outbox.work_off(now=NOW) == 0
    assert outbox.waiting() == 10


@pytest.mark.slow
def test_only_mails_that_wait_for_the_server_alone_count_as_old(
    server: smtp_server.Server, settings: Settings
) -> None:
    queue("gone@example.org", "full@example.org", "first@example.org")
    Mail.objects.update(queued_at=NOW - 2 * DAY)
    outbox.work_off(now=NOW)
    metrics = figures()
    assert metrics["tsttc_mails_oldest_age_seconds"] == 0
    assert metrics["tsttc_mails_waiting"] == metrics["tsttc_mails_put_off"] == 1
    assert metrics['tsttc_mails_ended_last_day{outcome="sent"}'] == 1
    assert metrics['tsttc_mails_ended_last_day{outcome="unsent"}'] == 1
    server.sender_answer = "530 5.7.0 Authentication required"
    queue("other@example.org")
    Mail.objects.update(queued_at=NOW - 2 * DAY)
    outbox.work_off(now=NOW)
    assert figures()["tsttc_mails_oldest_age_seconds"] > DAY.total_seconds()


def test_a_mail_that_is_refused_during_a_request_is_listed_at_once(server: smtp_server.Server) -> None:
    for recipient in ("gone@example.org", "full@example.org", "first@example.org"):
        outbox.send_or_keep(message=EmailMessage("S", "secret link", to=[recipient]), now=NOW)
    assert state_of("gone@example.org") == (True, "", "550 5.1.1 No such user")
    assert state_of("full@example.org") == (False, "secret link", "452 4.2.2 Mailbox full")
    assert server.taken == ["first@example.org"]


def test_a_server_that_breaks_off_is_waited_for_once_and_each_mail_is_kept(
    server: smtp_server.Server,
) -> None:
    recipients = ["gone@example.org", "crash@example.org", "first@example.org", "second@example.org"]
    messages = [EmailMessage("S", "T", to=[recipient]) for recipient in recipients]
    outbox.send_or_keep_all(messages=messages, now=NOW)
    assert server.asked == recipients[:2]
    assert outbox.waiting() == 3
    assert outbox.work_off(now=NOW + MINUTE) == 2


def test_maintainers_see_which_mails_were_not_sent_and_why(
    server: smtp_server.Server, client: Client, maintainer: User
) -> None:
    queue("gone@example.org", "full@example.org", "first@example.org")
    outbox.work_off(now=NOW)
    client.force_login(maintainer)
    page = client.get("/maintain/mails/").text
    assert "gone@example.org" in page
    assert "550 5.1.1 No such user" in page
    assert "452 4.2.2 Mailbox full" in page
    assert "first@example.org" not in page
    assert "secret link" not in page
    assert "/maintain/mails/" in client.get("/maintain/").text
