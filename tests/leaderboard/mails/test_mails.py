"""Mails may fail: nobody gets an error for it, and what could not be sent is sent later, once."""

import logging
import re
from datetime import timedelta
from io import StringIO

import pytest
from allauth.account.models import EmailAddress
from django.core import mail
from django.core.mail import EmailMessage
from django.core.management import call_command
from django.test import Client
from django.utils import timezone
from pytest_django import Settings

from leaderboard.editions import ground_truth
from leaderboard.errors.refusals import NotMaintainer
from leaderboard.mails import announcements, fault_reports, notices, outbox
from leaderboard.models import (
    ApiToken,
    AuditEvent,
    Edition,
    Mail,
    MailKind,
    Publication,
    Split,
    Submission,
    SweepBeat,
    User,
)
from tests import builders, pages
from tests.leaderboard.web.account.proving import proving

pytestmark = pytest.mark.django_db

HOUR = timedelta(hours=1)
DAY = timedelta(days=1)


@pytest.fixture
def away(settings: Settings) -> Settings:
    """A mail server that is not there."""
    settings.EMAIL_BACKEND = "django.core.mail.backends.smtp.EmailBackend"
    settings.EMAIL_HOST, settings.EMAIL_PORT = "127.0.0.1", 1
    return settings


def back(settings: Settings) -> None:
    settings.EMAIL_BACKEND = "django.core.mail.backends.locmem.EmailBackend"


def look_back() -> None:
    """Notices were last looked for an hour ago."""
    SweepBeat.objects.update_or_create(id=1, defaults={"notices_at": timezone.now() - HOUR})


def queue_due_mails() -> list[tuple[str, str]]:
    """Queue the mails that are due; return recipient and kind of each that is not sent yet."""
    notices.queue_due(now=timezone.now())
    return sorted(Mail.objects.filter(ended_at=None).values_list("recipient", "kind"))


# --- the outbox ------------------------------------------------------------------------------------------


def test_a_mail_that_no_server_takes_is_kept_and_sent_later(away: Settings) -> None:
    now = timezone.now()
    for _ in range(2):
        outbox.send_or_keep(message=EmailMessage("S", "T", to=["a@example.org"]), now=now)
    assert outbox.work_off(now=now) == 0
    assert outbox.work_off(now=now + HOUR) == 0
    back(away)
    assert outbox.work_off(now=now + 3 * HOUR) == 2
    assert [(sent.subject, sent.body, sent.to) for sent in mail.outbox] == [("S", "T", ["a@example.org"])] * 2
    # Nothing of them stays.
    assert set(Mail.objects.values_list("recipient", "text", "is_sent")) == {("", "", True)}
    assert outbox.work_off(now=now + DAY) == 0
    outbox.purge(now=now + 40 * DAY)
    assert not Mail.objects.exists()


def test_what_cannot_be_sent_for_three_days_is_given_up(away: Settings) -> None:
    now = timezone.now()
    outbox.send_or_keep(message=EmailMessage("S", "T", to=["a@example.org"]), now=now)
    outbox.work_off(now=now + 4 * DAY)
    assert Mail.objects.values_list("text", "is_sent", "ended_at").get() == ("", False, now + 4 * DAY)
    assert outbox.waiting() == 0


@pytest.mark.parametrize("path", ["/accounts/signup/", "/accounts/password/reset/", "/accounts/login/"])
def test_a_page_that_sends_a_mail_works_without_a_server(away: Settings, client: Client, path: str) -> None:
    proving(away)
    word = "a-long-enough-word"
    if path != "/accounts/signup/":
        User.objects.create_user("ada@example.org", word)
    fields = {"email": "ada@example.org", "login": "ada@example.org", "name": "Ada", "password": word}
    answer = client.post(path, {**fields, "password1": word, "password2": word})
    assert answer.status_code == 302
    assert Mail.objects.get(ended_at=None).recipient == "ada@example.org"
    back(away)
    outbox.work_off(now=timezone.now() + HOUR)
    assert re.search("/accounts/password/reset/|[A-Z]{4}-[A-Z]{4}", mail.outbox[0].body)


def test_a_superuser_can_sign_in_without_a_mail(away: Settings, client: Client) -> None:
    away.ACCOUNT_EMAIL_VERIFICATION = "mandatory"
    user = User.objects.create_user("old@example.org", "x", is_superuser=True)
    call_command("createsuperuser", email="Root@example.org", interactive=False, stdout=StringIO())
    proved = EmailAddress.objects.filter(verified=True, primary=True)
    assert set(proved.values_list("email", flat=True)) == {"root@example.org", user.email}
    root = User.objects.get(email="root@example.org")
    root.set_password("a-long-enough-word")
    root.save()
    answer = client.post("/accounts/login/", {"login": root.email, "password": "a-long-enough-word"})
    assert answer["Location"] == "/maintain/"
    assert not Mail.objects.exists()


# --- notices ---------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_file_sent_on_the_site_brings_one_mail_with_its_outcome(edition: Edition, owner: User) -> None:
    look_back()
    submission = builders.submit(owner, builders.predictions(edition), visibility="PRIVATE")
    assert queue_due_mails() == []
    builders.score_all()
    assert queue_due_mails() == [(owner.email, "scored")]
    outbox.work_off(now=timezone.now())
    [sent] = mail.outbox
    assert sent.subject == "[TSTTC leaderboard] Foo on Test was scored"
    assert f"/submissions/{submission.pk}/" in sent.body
    assert "Choose which emails you get: http://127.0.0.1:8000/mails/" in sent.body
    assert sent.extra_headers["List-Unsubscribe"] == "<http://127.0.0.1:8000/mails/>"
    assert queue_due_mails() == []


@pytest.mark.slow
def test_nobody_gets_mails_that_they_switched_off_or_of_a_team_that_they_left(
    edition: Edition, owner: User, signed_in: Client
) -> None:
    look_back()
    builders.submit(owner, builders.predictions(edition))
    builders.score_all()
    answer = signed_in.post("/mails/", {"wanted": ["edition", "token"]})
    assert answer.status_code == 302
    assert queue_due_mails() == []
    owner.refresh_from_db()
    assert notices.muted_by(owner) == {"scored", "deadline", "announcement"}
    page = signed_in.get("/mails/").content.decode()
    assert page.count(" checked") == 2
    assert signed_in.post("/mails/", {"wanted": ["account"]}).status_code == 422
    notices.choose(user=owner, wanted=MailKind.values)
    owner.membership.delete()
    look_back()
    assert queue_due_mails() == []


def test_the_teams_of_a_board_get_a_mail_about_its_new_edition(
    rescored: Edition, owner: User, stranger: User
) -> None:
    look_back()
    # The same moment as the database's clock in a publication.
    ground_truth.make_board(
        edition=rescored, kind=Publication.Kind.PUBLISHED, reason="A label.", now=timezone.now(), actor=None
    )
    of_edition = {row for row in queue_due_mails() if row[1] == "edition"}
    assert (owner.email, "edition") in of_edition
    assert stranger.email not in {recipient for recipient, _ in of_edition}
    text = Mail.objects.get(kind="edition", user=owner).text
    assert "Reason: A label." in text
    assert "/board/test/editions/" in text


@pytest.mark.slow
def test_tokens_that_end_and_splits_that_close_bring_mails_to_those_concerned(
    edition: Edition, owner: User, stranger: User
) -> None:
    now = timezone.now()
    for user, created, ends in ((owner, 60, 6), (owner, 60, 9), (stranger, 1, 5)):
        builders.token(user)
        row = ApiToken.objects.order_by("-created").first()
        ApiToken.objects.filter(pk=row.pk).update(created=now - created * DAY, expiry=now + ends * DAY)
    assert queue_due_mails() == [(owner.email, "token")]
    builders.submit(owner, builders.predictions(edition))
    Split.objects.filter(pk="test").update(closes_at=now + 2 * DAY)
    assert queue_due_mails() == [(owner.email, "deadline"), (owner.email, "token")]
    assert "close on" in Mail.objects.get(kind="deadline").subject


@pytest.mark.slow
def test_a_maintainer_previews_an_announcement_and_sends_it_once(
    edition: Edition, owner: User, keeper: Client
) -> None:
    assert "Nobody would get this email now." in keeper.get("/maintain/splits/test/mail/").text
    builders.submit(owner, builders.predictions(edition))
    lead = pages.get(keeper, "/maintain/splits/test/mail/").one("p", class_="lead")
    assert "goes to 1 person: everyone whose team has submitted to Test, except" in lead.text
    address, draft = "/maintain/splits/test/mail/", {"subject": "Moved", "text": "First.\r\n\r\nSecond <b>."}
    assert keeper.post(address, {"subject": "", "text": " "}).status_code == 422
    assert keeper.post(address, draft | {"subject": "x" * 151}).status_code == 422
    page = keeper.post(address, draft | {"step": "preview"}).content.decode()
    assert "1 person gets" in page
    assert "[TSTTC leaderboard] Moved" in page
    assert "Second &lt;b&gt;." in page
    assert owner.email not in page
    assert "First." in keeper.post(address, draft | {"step": "write"}).content.decode()
    assert not Mail.objects.exists()
    for words in ("The email to 1 person is queued.", "Nothing was sent"):  # a double click
        assert words in keeper.post(address, draft | {"step": "send"}, follow=True).content.decode()
    assert queue_due_mails() == [(owner.email, "announcement")]
    assert Mail.objects.get().text.startswith("First.\n\nSecond <b>.\n\n--\n")
    event = AuditEvent.objects.get(verb="announced")
    assert event.details == {"subject": "Moved", "n_people": 1}
    assert "Nobody gets this email" in keeper.post(address, draft | {"step": "preview"}).content.decode()
    with pytest.raises(NotMaintainer):
        announcements.announce(
            announcements.cleaned(split=edition.split, subject="S", text="T"), now=timezone.now(), actor=owner
        )


@pytest.mark.slow
def test_only_proved_addresses_get_notices_where_addresses_are_proved(
    settings: Settings, edition: Edition, owner: User
) -> None:
    settings.ACCOUNT_EMAIL_VERIFICATION = "mandatory"
    look_back()
    builders.submit(owner, builders.predictions(edition))
    builders.score_all()
    assert queue_due_mails() == []
    EmailAddress.objects.create(user=owner, email=owner.email, verified=True, primary=True)
    look_back()
    assert queue_due_mails() == [(owner.email, "scored")]


def test_a_program_asks_for_its_own_outcome(edition: Edition, owner: User) -> None:
    look_back()
    submission = builders.submit(owner, builders.predictions(edition))
    Submission.objects.filter(pk=submission.pk).update(via="API")
    builders.score_all()
    assert queue_due_mails() == []


# --- faults of ours --------------------------------------------------------------------------------------


def test_a_fault_is_reported_once_an_hour_to_each(settings: Settings) -> None:
    settings.ERROR_EMAILS = ["a@example.org", "b@example.org"]
    handler = fault_reports.FaultReportHandler(level=logging.ERROR)
    for text in ("It broke.", "It broke again."):
        handler.handle(logging.LogRecord("web", logging.ERROR, "x.py", 7, text, (), None))
    assert sorted(Mail.objects.values_list("recipient", "text")) == [
        ("a@example.org", "It broke."),
        ("b@example.org", "It broke."),
    ]
