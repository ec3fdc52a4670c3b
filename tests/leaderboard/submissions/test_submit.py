"""`submissions.submit`: what is taken, what is refused, what is kept."""

import re

import pytest
from django.utils import timezone

from leaderboard import board_versions
from leaderboard.errors.refusals import Refused
from leaderboard.models import AuditEvent, Edition, Method, Status, Submission, Team, User
from leaderboard.storage import files
from tests import builders


def test_submission_is_stored_queued_and_recorded(edition: Edition, owner: User) -> None:
    data = builders.predictions(edition)
    submission = builders.submit(owner, data, note="first try", paper_url="https://example.org/p")
    assert submission.evaluations.get().status == Status.QUEUED
    assert submission.method.paper_url == "https://example.org/p"
    with files.opened_predictions(submission.digest) as kept:
        assert kept.read() == data
    assert AuditEvent.objects.filter(verb="submitted", noun_id=submission.pk, actor=owner).count() == 1


def test_withdrawn_bytes_may_be_sent_again(edition: Edition, owner: User) -> None:
    data = builders.predictions(edition)
    first = builders.submit(owner, data)
    Submission.objects.filter(pk=first.pk).update(withdrawn_at=timezone.now())
    assert builders.submit(owner, data) != first


def test_a_user_without_a_name_gets_a_team_that_reveals_no_address(edition: Edition, db: None) -> None:
    nameless = User.objects.create_user("very.private@example.org", "correct horse")
    team = builders.submit(nameless, builders.predictions(edition)).method.team
    assert re.fullmatch("Team [0-9a-f]{6}", team.name)


def test_what_a_later_submission_says_of_a_method_replaces_the_former(edition: Edition, owner: User) -> None:
    builders.submit(owner, builders.predictions(edition), description="old", code_url="https://example.org/c")
    builders.submit(owner, builders.predictions(edition, factor=1.2), description="new")
    method = Method.objects.get()
    assert (method.description, method.code_url) == ("new", "https://example.org/c")
    [event] = AuditEvent.objects.filter(noun="Method", verb="edited")
    assert (event.actor, event.noun_id) == (owner, str(method.pk))
    assert event.details == {"fields": ["description"]}


def test_bytes_that_are_there_change_nothing_of_the_method(edition: Edition, owner: User) -> None:
    first = builders.submit(owner, builders.predictions(edition), description="old")
    number, n_events = board_versions.number_of("test"), AuditEvent.objects.count()
    again = builders.submit(
        owner, builders.predictions(edition), description="new", paper_url="https://x.org"
    )
    assert again == first
    method = Method.objects.get()
    assert (method.description, method.paper_url) == ("old", "")
    assert (board_versions.number_of("test"), AuditEvent.objects.count()) == (number, n_events)


@pytest.mark.parametrize(
    ("fields", "code", "field"),
    [
        ({"split": "nope"}, "unknown-split", "split"),
        ({"split": "val"}, "split-not-open", "split"),
        ({"method": "   "}, "missing-field", "method"),
        ({"method": "a\ud800b"}, "bad-character", "method"),
        ({"paper_url": "javascript:alert(1)"}, "bad-address", "paper_url"),
        ({"note": "x" * 501}, "text-too-long", "note"),
    ],
)
def test_refused_input_names_its_field_and_leaves_nothing(
    edition: Edition, owner: User, fields: dict[str, str], code: str, field: str
) -> None:
    with pytest.raises(Refused) as caught:
        builders.submit(owner, builders.predictions(edition), **fields)
    assert (caught.value.code, caught.value.field) == (code, field)
    assert not Submission.objects.exists()
    assert not Method.objects.exists()
    assert not Team.objects.exists()


def test_file_over_the_limit_is_refused_with_both_sizes(edition: Edition, owner: User, settings) -> None:
    settings.MAX_PREDICTIONS_BYTES = 1000
    with pytest.raises(Refused, match=r"is 2 kB; expected at most 1 kB"):
        builders.submit(owner, b" " * 1001)
    assert not Submission.objects.exists()


def test_file_name_is_shown_never_used(edition: Edition, owner: User) -> None:
    submission = builders.submit(owner, builders.predictions(edition), filename="..\\..\\etc/pass\x00wd")
    assert submission.filename == "passwd"


def test_a_latency_without_hardware_is_refused_for_a_new_method_and_a_known_one(
    edition: Edition, owner: User
) -> None:
    def send(factor: float, **details: str) -> None:
        builders.send(owner, builders.predictions(edition, factor=factor), **details)

    with pytest.raises(Refused, match="what the latency was measured on"):
        send(1.1, latency_ms="3.5")
    assert not Method.objects.exists()
    assert not Submission.objects.exists()
    send(1.1)
    with pytest.raises(Refused, match="what the latency was measured on"):
        send(1.2, latency_ms="3.5")
    send(1.2, latency_ms="3.5", hardware="one GPU")
    # What is known of the hardware holds for another latency.
    send(1.3, latency_ms="4.5")
    method = Method.objects.get()
    assert (method.latency_ms, method.hardware) == (4.5, "one GPU")
