"""Following a submission: each answer says whether, and when, to ask again."""

from datetime import timedelta

import pytest
from django.db.models.functions import Now

from leaderboard.models import Edition, Evaluation, Status, Submission, User
from leaderboard.submissions import progress
from tests import builders
from tests.leaderboard.api.test_submissions import client_of
from tests.leaderboard.web.maintain import queue_rows


def address(submission: Submission) -> str:
    return f"/api/v1/submissions/{submission.pk}"


@pytest.fixture
def waiting_one(edition: Edition, owner: User) -> Submission:
    return builders.submit(owner, builders.predictions(edition))


def test_the_answer_asks_to_come_back_in_a_second_until_it_is_final(
    waiting_one: Submission, owner: User
) -> None:
    client = client_of(owner)
    queued = client.get(address(waiting_one))
    assert (queued.json()["state"], queued.headers["Retry-After"]) == ("QUEUED", "1")
    queue_rows.claim()
    running = client.get(address(waiting_one))
    assert (running.json()["state"], running.headers["Retry-After"]) == ("RUNNING", "1")


def test_an_answer_that_is_known_is_not_sent_again_and_says_when_to_come_back(
    waiting_one: Submission, owner: User
) -> None:
    client = client_of(owner)
    known = {"If-None-Match": client.get(address(waiting_one)).headers["ETag"]}
    again = client.get(address(waiting_one), headers=known)
    assert (again.status_code, again.content, again.headers["Retry-After"]) == (304, b"", "1")
    builders.score_all()
    scored = client.get(address(waiting_one), headers=known)
    assert (scored.json()["state"], scored.headers.get("Retry-After")) == ("SCORED", None)


@pytest.mark.parametrize("state", [Status.REJECTED, Status.CANCELLED, Status.SYSTEM_ERROR, Status.SCORED])
def test_what_is_decided_asks_nobody_to_come_back_and_is_never_late(
    waiting_one: Submission, owner: User, state: Status
) -> None:
    # Made by hand: a file that no run decides so, and long ago.
    Evaluation.objects.update(status=state, finished_at=Now(), queued_at=Now() - timedelta(days=1))
    answer = client_of(owner).get(address(waiting_one))
    document = answer.json()
    assert (document["state"], document["is_final"]) == (state, True)
    assert "Retry-After" not in answer.headers
    assert not progress.progress_of(waiting_one).is_late
    assert progress.progress_of(waiting_one).n_ahead is None
