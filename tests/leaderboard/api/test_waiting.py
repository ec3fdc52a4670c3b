"""Following a submission: each answer says whether, and when, to ask again."""

import pytest

from leaderboard.models import Edition, Submission, User
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
