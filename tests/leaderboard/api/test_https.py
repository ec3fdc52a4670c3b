"""http instead of https: the API refuses it, pages redirect."""

import pytest
from django.test import Client
from pytest_django import Settings

from leaderboard.models import Edition, User
from tests import builders


@pytest.fixture(autouse=True)
def https(settings: Settings) -> None:
    settings.SECURE_SSL_REDIRECT = True


@pytest.mark.parametrize("method", ["get", "post", "put", "head", "options"])
@pytest.mark.parametrize("path", ["/api/v1/submissions", "/api/v1/splits", "/api/v1/nothing"])
def test_the_api_answers_http_with_a_problem_that_no_client_takes_for_success(
    edition: Edition, owner: User, method: str, path: str
) -> None:
    headers = {"Authorization": f"Bearer {builders.token(owner)}"}
    refused = getattr(Client(), method)(path, headers=headers)
    assert (refused.status_code, refused["Content-Type"]) == (403, "application/problem+json")
    assert "Location" not in refused
    if method != "head":
        assert refused.json()["code"] == "https-required"
        assert "expected https://" in refused.json()["detail"]
        assert "revoke it" in refused.json()["detail"]


def test_pages_redirect_and_both_answer_https(edition: Edition) -> None:
    redirected = Client().get("/board/test/")
    assert (redirected.status_code, redirected["Location"]) == (301, "https://testserver/board/test/")
    for path in ("/board/test/", "/api/v1/splits"):
        assert Client().get(path, secure=True).status_code == 200
