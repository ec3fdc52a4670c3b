"""What failed by our fault is seen by maintainers, and retried by them alone, on the record."""

import random
from typing import Any

import pytest
from django.contrib.auth.models import Permission
from django.test import Client

from leaderboard import lifecycle
from leaderboard.lifecycle import Strike
from leaderboard.models import AuditEvent, Edition, Evaluation, Status, User
from tests import builders
from tests.leaderboard import queue_rows

LIST = "/admin/leaderboard/evaluation/"


@pytest.fixture
def failed(edition: Edition, owner: User) -> Evaluation:
    """An evaluation that struck out."""
    submission = builders.submit(owner, builders.predictions(edition))
    for _ in range(lifecycle.MAX_POISON_STRIKES):
        queue_rows.make_due()
        lifecycle.give_back(queue_rows.claim(), strike=Strike.POISON, reason="signal 9", rng=random.Random(0))
    found = submission.evaluations.get()
    assert found.status == Status.SYSTEM_ERROR
    return found


def visit(user: User | None) -> Client:
    client = Client()
    if user is not None:
        client.force_login(user)
    return client


def retry(client: Client, *evaluations: Evaluation) -> Any:
    chosen = {"action": "retry", "_selected_action": [str(each.pk) for each in evaluations]}
    return client.post(LIST, chosen, follow=True)


def test_maintainer_sees_how_many_failed_and_why(failed: Evaluation, maintainer: User) -> None:
    page = visit(maintainer).get(LIST)
    assert "1 failed by our fault and wait to be retried" in page.text
    assert "signal 9" in page.text


def test_nothing_failed_is_not_worth_a_heading(edition: Edition, maintainer: User) -> None:
    assert "wait to be retried" not in visit(maintainer).get(LIST).text


def test_maintainer_retries_and_the_file_is_scored(failed: Evaluation, maintainer: User) -> None:
    page = retry(visit(maintainer), failed)
    assert "Queued again: 1." in page.text
    failed.refresh_from_db()
    assert (failed.status, failed.n_poison_strikes, failed.finished_at) == (Status.QUEUED, 0, None)
    assert builders.score_all() == 1
    failed.refresh_from_db()
    assert failed.status == Status.SCORED


def test_retry_is_on_the_record_with_who_and_what(failed: Evaluation, maintainer: User) -> None:
    retry(visit(maintainer), failed)
    event = AuditEvent.objects.get(verb="retried")
    assert (event.actor, event.noun, event.noun_id) == (maintainer, "Evaluation", str(failed.pk))
    assert event.details == {"reason": "from the administration"}


def test_retrying_twice_is_one_retry(failed: Evaluation, maintainer: User) -> None:
    client = visit(maintainer)
    retry(client, failed)
    page = retry(client, failed)
    assert "there is nothing to retry" in page.text
    assert AuditEvent.objects.filter(verb="retried").count() == 1


@pytest.mark.parametrize("status", [Status.SCORED, Status.REJECTED])
def test_what_is_decided_is_not_retried(
    edition: Edition, owner: User, maintainer: User, status: Status
) -> None:
    row = queue_rows.queued(edition, owner)
    outcome = queue_rows.SCORED if status == Status.SCORED else queue_rows.REJECTED
    lifecycle.finalise(queue_rows.claim(), outcome)
    assert "Queued again: 0." in retry(visit(maintainer), row).text
    row.refresh_from_db()
    assert row.status == status
    assert not AuditEvent.objects.filter(verb="retried").exists()


@pytest.mark.parametrize("who", ["owner", "teammate", "stranger", "nobody"])
def test_nobody_but_a_maintainer_retries(
    failed: Evaluation, who: str, request: pytest.FixtureRequest
) -> None:
    user = None if who == "nobody" else request.getfixturevalue(who)
    page = retry(visit(user), failed)
    assert page.redirect_chain[-1][0].startswith(("/admin/login/", "/accounts/login/"))
    failed.refresh_from_db()
    assert failed.status == Status.SYSTEM_ERROR
    assert not AuditEvent.objects.filter(verb="retried").exists()


def test_staff_without_the_right_to_evaluations_retries_nothing(failed: Evaluation, stranger: User) -> None:
    stranger.is_staff = True
    stranger.save()
    assert retry(visit(stranger), failed).status_code == 403
    failed.refresh_from_db()
    assert failed.status == Status.SYSTEM_ERROR


def test_staff_with_the_right_to_look_may_retry(failed: Evaluation, stranger: User) -> None:
    stranger.is_staff = True
    stranger.save()
    stranger.user_permissions.add(Permission.objects.get(codename="view_evaluation"))
    assert "Queued again: 1." in retry(visit(stranger), failed).text


def test_maintainer_changes_no_evaluation_by_hand(failed: Evaluation, maintainer: User) -> None:
    client = visit(maintainer)
    page = f"{LIST}{failed.pk}/change/"
    assert client.get(page).status_code == 200
    assert client.post(page, {"status": "SCORED"}).status_code == 403
    assert client.post(f"{LIST}{failed.pk}/delete/", {"post": "yes"}).status_code == 403
    assert client.post(f"{LIST}add/").status_code == 403
