"""Deletion of methods that never had a scored submission."""

import pytest
from django.test import Client
from django.utils import timezone

from leaderboard import audit
from leaderboard.errors.refusals import Refused
from leaderboard.models import AuditEvent, Edition, Method, Submission, User
from leaderboard.moderation import empty_methods
from leaderboard.people import invitations, teams
from leaderboard.quotas import usage
from leaderboard.submissions import intake
from tests import builders, pages


@pytest.fixture
def rejected(edition: Edition, owner: User) -> Submission:
    """A broken upload of a method that it made."""
    sent = builders.submit(owner, b"[]", method="Broken Net", visibility="PRIVATE")
    builders.score_all()
    return sent


def test_the_method_of_a_broken_upload_is_deleted_its_file_stays_and_its_name_is_free(
    signed_in: Client, edition: Edition, rejected: Submission, owner: User
) -> None:
    address = f"/methods/{rejected.method_id}/"
    page = pages.page(signed_in.get(address)).one("main")
    assert f"{address}delete/" in [a.attributes["href"] for a in page.all("a")]
    assert signed_in.get(f"{address}delete/").status_code == 200
    done = pages.page(signed_in.post(f"{address}delete/", {"confirm": "on"}, follow=True)).one("main")
    assert "Broken Net is deleted." in done.text
    assert "deleted" in done.one("tbody").one("tr").text
    assert signed_in.get(address).status_code == 404
    assert not pages.page(signed_in.get("/submit/")).one("datalist").all("option")
    event = AuditEvent.objects.get(verb="deleted")
    assert (event.actor, event.noun_id) == (owner, str(rejected.method_id))
    assert audit.names_in([event]) == {event.details["name"]: "Broken Net"}
    again = builders.submit(owner, builders.predictions(edition), method="Broken-Net")
    assert again.method_id != rejected.method_id
    state = usage.state(team=again.method.team, user=owner, split=edition.split, now=timezone.now())
    assert state.n_rejected == 1, "a deletion gives no rejection back"


def test_what_has_a_score_waits_or_was_shown_stays(
    edition: Edition, rejected: Submission, owner: User, stranger: User, maintainer: User
) -> None:
    method, now = rejected.method, timezone.now()
    for other in (stranger, maintainer):
        with pytest.raises(Refused, match="Only the team"):
            empty_methods.delete(method=method, actor=other, now=now)
    builders.submit(owner, builders.predictions(edition), method="Broken Net", visibility="PRIVATE")
    for _ in ("waiting", "scored"):
        with pytest.raises(Refused, match="expected a private method without a scored or waiting submission"):
            empty_methods.delete(method=method, actor=owner, now=now)
        builders.score_all()
    shown = builders.submit(owner, b"[]", method="Shown").method
    builders.score_all()
    assert not empty_methods.can_be_deleted(shown)
    assert Method.objects.existing().count() == Method.objects.count() == 2


def test_what_cannot_be_deleted_says_what_keeps_it_and_leads_to_withdrawing(
    signed_in: Client, edition: Edition, owner: User
) -> None:
    sent = builders.submit(owner, builders.predictions(edition), method="Scored", visibility="PRIVATE")
    address = f"/methods/{sent.method_id}/delete/"
    main = pages.get(signed_in, address).one("main")
    assert "1 submission of it has no result yet" in main.text
    assert f"/submissions/{sent.pk}/" in [a.attributes["href"] for a in main.all("a")]
    builders.score_all()
    offered = [a.text for a in pages.get(signed_in, address[:-7]).one("main").all("a")]
    assert "Delete…" not in offered, "it would lead to a refusal"
    main = pages.get(signed_in, address).one("main")
    assert main.one("h1").text == "“Scored” cannot be deleted"
    assert "It has 1 scored submission." in main.text
    (link,) = [a for a in main.all("a") if a.text == "withdraw its submissions"]
    assert link.attributes["href"] == f"/submissions/?method={sent.method_id}"
    intake.withdraw(submission=sent, actor=owner, now=timezone.now())
    assert not empty_methods.can_be_deleted(sent.method), "as the page says"
    builders.submit(owner, builders.predictions(edition), method="Shown", visibility="PUBLIC")
    shown = Method.objects.get(name="Shown")
    main = pages.get(signed_in, f"/methods/{shown.pk}/delete/").one("main")
    assert "The method is public: everyone has seen it" in main.text


def test_a_cancelled_submission_no_longer_keeps_its_method(edition: Edition, owner: User) -> None:
    sent = builders.submit(owner, builders.predictions(edition), method="Waiting", visibility="PRIVATE")
    assert not empty_methods.can_be_deleted(sent.method)
    intake.withdraw(submission=sent, actor=owner, now=timezone.now())
    assert empty_methods.can_be_deleted(sent.method)


def test_a_deleted_method_comes_along_to_another_team_and_takes_no_name(
    edition: Edition, rejected: Submission, owner: User, stranger: User
) -> None:
    empty_methods.delete(method=rejected.method, actor=owner, now=timezone.now())
    builders.submit(owner, builders.predictions(edition), method="Broken Net", visibility="PRIVATE")
    theirs = teams.team_of(user=stranger)
    _, secret = invitations.make(team=theirs, actor=stranger, now=timezone.now())
    invitations.accept(secret=secret, user=owner, now=timezone.now())
    assert set(Method.objects.values_list("name", "team")) == {("Broken Net", theirs.pk)}
    assert [method.name for method in Method.objects.of(stranger)] == ["Broken Net"]


def test_of_two_empty_methods_one_is_deleted_with_its_files_and_the_other_stays(
    edition: Edition, rejected: Submission, owner: User
) -> None:
    other = builders.submit(owner, b"{}", method="Other Net", visibility="PRIVATE")
    builders.score_all()
    empty_methods.delete(method=rejected.method, actor=owner, now=timezone.now())
    for sent, is_deleted in ((rejected, True), (other, False)):
        sent.refresh_from_db()
        assert (sent.withdrawn_at is not None) is is_deleted
        assert (Method.objects.get(pk=sent.method_id).deleted_at is not None) is is_deleted
    assert AuditEvent.objects.filter(verb="deleted").count() == 1


def test_a_method_without_any_file_is_deleted_by_its_team_alone(
    edition: Edition, rejected: Submission, owner: User, stranger: User, maintainer: User
) -> None:
    intake.withdraw(submission=rejected, actor=owner, now=timezone.now())
    for other in (stranger, maintainer):
        with pytest.raises(Refused, match="Only the team"):
            empty_methods.delete(method=rejected.method, actor=other, now=timezone.now())
    empty_methods.delete(method=rejected.method, actor=owner, now=timezone.now())
    assert Method.objects.get(pk=rejected.method_id).deleted_at is not None
