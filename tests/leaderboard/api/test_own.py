"""Answers for a team itself only: whose token it is, and the bytes of a file."""

import pytest
from rest_framework.test import APIClient

from leaderboard.models import Edition, Scope, Submission, User
from leaderboard.storage import files
from tests import builders

ABSENT = "/api/v1/submissions/00000000-0000-4000-8000-000000000000/file"


def client_of(user: User | None, **limits: object) -> APIClient:
    """A client with a token of that person, or with none."""
    client = APIClient()
    if user is not None:
        client.credentials(HTTP_AUTHORIZATION=f"Bearer {builders.token(user, **limits)}")
    return client


@pytest.fixture
def submission(edition: Edition, owner: User) -> Submission:
    return builders.submit(owner, builders.predictions(edition))


def address(submission: Submission) -> str:
    return f"/api/v1/submissions/{submission.pk}/file"


def test_a_team_gets_its_file_back_byte_by_byte(
    edition: Edition, submission: Submission, owner: User, teammate: User
) -> None:
    for member in (owner, teammate):
        response = client_of(member).get(address(submission))
        assert response.status_code == 200
        assert response.getvalue() == builders.predictions(edition)
        assert response.headers["Content-Type"] == "application/octet-stream"
        assert response.headers["Content-Disposition"].startswith("attachment; filename=")


def test_the_file_of_another_team_does_not_exist_though_the_method_is_public(
    submission: Submission, stranger: User, maintainer: User
) -> None:
    for other in (stranger, maintainer):
        client = client_of(other)
        response, absent = client.get(address(submission)), client.get(ABSENT)
        assert (response.status_code, response.json()) == (404, absent.json())
    assert client_of(None).get(address(submission)).status_code == 401


def test_a_token_gives_the_file_within_its_limits_only(submission: Submission, owner: User) -> None:
    response = client_of(owner, scopes=(Scope.SUBMIT,)).get(address(submission))
    assert (response.status_code, response.json()["code"]) == (403, "token-scope")
    assert client_of(owner, split_name="val").get(address(submission)).status_code == 404
    assert client_of(owner, split_name="test").get(address(submission)).getvalue() != b""


def test_a_file_that_the_store_has_lost_is_the_fault_of_the_store(
    submission: Submission, owner: User
) -> None:
    files.store().delete(files.predictions_name(submission.digest))
    answer = client_of(owner).get(address(submission))
    assert (answer.status_code, answer.json()["code"]) == (503, "store-unavailable")


@pytest.mark.parametrize("scope", [Scope.READ, Scope.SUBMIT])
def test_every_token_may_ask_whose_it_is_and_no_person_is_named(
    submission: Submission, owner: User, scope: Scope
) -> None:
    client = client_of(owner, scopes=(scope,), split_name="test")
    account = client.get("/api/v1/account").json()
    assert account["expires_at"].endswith("Z")
    assert {**account, "expires_at": None} == {
        "team": "Owls",
        "token": "CI",
        "scopes": [scope.value],
        "split": "test",
        "expires_at": None,
    }
    assert owner.email not in str(account)
    assert client_of(None).get("/api/v1/account").status_code == 401
