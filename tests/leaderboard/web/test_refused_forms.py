"""The page for a refused form names the cause that was found."""

from typing import Any

import pytest
from django.test import Client

from leaderboard.models import User
from tests import pages

CAUSES: dict[str, tuple[dict[str, Any], bool, str]] = {
    "cookie": ({}, False, "sent no cookie of this site"),
    "old form": ({}, True, "older than your present sign-in"),
    "origin": ({"HTTP_ORIGIN": "https://evil.example"}, True, "came from https://evil.example; expected"),
    "origin null": ({"HTTP_ORIGIN": "null"}, True, "came from null; expected"),
    "referer": ({"HTTPS": True}, True, "its Referer is missing or wrong"),
    "other referer": ({"HTTPS": True, "HTTP_REFERER": "https://b.example/x"}, True, "https://b.example/x"),
}


@pytest.mark.parametrize("name", CAUSES)
def test_a_refused_form_names_its_cause(owner: User, name: str) -> None:
    headers, has_cookie, words = CAUSES[name]
    client = Client(enforce_csrf_checks=True)
    client.force_login(owner)
    if has_cookie:
        client.get("/submit/")
    options = {key: value for key, value in headers.items() if key != "HTTPS"}
    response = client.post(
        "/submit/", {"csrfmiddlewaretoken": "a" * 64}, secure="HTTPS" in headers, **options
    )
    text = pages.page(response).one("main").text
    assert response.status_code == 403
    assert words in text
    assert ("signed in or out" in text) == (name == "old form")
