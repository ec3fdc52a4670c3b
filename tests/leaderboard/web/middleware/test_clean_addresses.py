"""A page's address names what is set: one with empty parameters leads to the same without them."""

import pytest
from django.test import Client

from leaderboard.models import Edition, User


@pytest.mark.parametrize(
    ("asked", "clean"),
    [
        ("/board/test/?q=box&frames=&cameras=&boxes=", "/board/test/?q=box"),
        ("/board/test/?q=&frames=", "/board/test/"),
        ("/board/val/?sort=-rte&q=", "/board/val/?sort=-rte"),
        ("/board/test/editions/1/?at=&q=a%26b%3D", "/board/test/editions/1/?q=a%26b%3D"),
        ("/compare/?split=test&m=1&m=2&with=", "/compare/?split=test&m=1&m=2"),
        ("/submissions/?q=&split=test&state=", "/submissions/?split=test"),
        ("/accounts/login/?next=", "/accounts/login/"),
    ],
)
def test_form_with_empty_fields_leads_to_a_clean_address(
    client: Client, edition: Edition, asked: str, clean: str
) -> None:
    response = client.get(asked)
    assert (response.status_code, response.headers["Location"]) == (302, clean)
    assert client.get(clean).status_code != 302 or "/accounts/login/?next=" in client.get(clean)["Location"]


@pytest.mark.parametrize(
    "asked",
    [
        "/board/test/?q=box",
        "/board/test/?q=a%3D%26b",
        "/board/test.csv?q=",
        "/api/v1/splits/test/board?q=",
    ],
)
def test_what_is_clean_and_what_programs_ask_for_is_answered_as_it_is(
    client: Client, edition: Edition, asked: str
) -> None:
    assert client.get(asked).status_code == 200


def test_script_that_asks_for_a_part_is_answered(client: Client, edition: Edition) -> None:
    assert client.get("/board/test/?q=", headers={"HX-Request": "true"}).status_code == 200


@pytest.mark.parametrize("path", ["/\\elsewhere.example/", "/%0d%0aSet-Cookie:a=b/"])
def test_nobody_is_led_elsewhere(client: Client, edition: Edition, owner: User, path: str) -> None:
    response = client.get(f"{path}?q=")
    location = response.headers.get("Location", "")
    assert location.startswith(("/%5C", "/%0D")) or response.status_code == 404
    assert "Set-Cookie:a=b" not in str(response.headers.get("Set-Cookie"))
