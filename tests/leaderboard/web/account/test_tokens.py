"""The page of one's API tokens."""

from datetime import timedelta

import pytest
from django.contrib.sessions.models import Session
from django.test import Client
from django.utils import timezone
from rest_framework.test import APIClient

from leaderboard.models import ApiToken, User
from tests import builders, pages
from tests.leaderboard.web.account.proving import confirm
from tests.leaderboard.web.test_every_page import assert_sound

PAGE = "/tokens/"
FIELDS = {"name": "nightly CI", "scopes": ["read", "submit"], "split": "", "days": "90"}


@pytest.fixture(autouse=True)
def _confirmed(signed_in: Client) -> None:
    confirm(signed_in)


def make(client: Client, **fields: object) -> pages.Element:
    led = client.post(PAGE, {**FIELDS, **fields})
    assert (led.status_code, led.headers["Location"]) == (302, PAGE)
    response = client.get(PAGE)
    assert "no-store" in response.headers["Cache-Control"]
    return assert_sound(response)


def listed(client: Client) -> list[list[str]]:
    root = assert_sound(client.get(PAGE))
    return [[cell.text for cell in row.all("td")] for body in root.all("tbody") for row in body.all("tr")]


def test_between_form_and_page_a_new_token_is_with_the_browser_alone(
    signed_in: Client, stranger: User, benchmark: None
) -> None:
    led = signed_in.post(PAGE, FIELDS)
    cookie = led.cookies["shown-once"]
    assert (cookie["path"], cookie["httponly"], cookie["samesite"]) == (PAGE, True, "Strict")
    assert cookie["max-age"] == 120
    secret = cookie.value.partition(":")[0]
    assert ApiToken.objects.get().token_key == secret[:15]
    assert secret not in str([session.get_decoded() for session in Session.objects.all()])
    other = Client()
    other.force_login(stranger)
    other.cookies["shown-once"] = cookie.value
    assert secret not in other.get(PAGE).content.decode()
    shown = signed_in.get(PAGE)
    assert secret in shown.content.decode()
    assert shown.cookies["shown-once"]["max-age"] == 0
    assert secret not in signed_in.get(PAGE).content.decode()
    assert ApiToken.objects.count() == 1


def test_the_list_tells_name_use_and_end(signed_in: Client, benchmark: None) -> None:
    make(signed_in, name="val only", scopes=["read"], split="val", days="30")
    [row] = listed(signed_in)
    expiry = ApiToken.objects.get().expiry
    assert expiry is not None
    assert timedelta(days=29) < expiry - timezone.now() <= timedelta(days=30)
    assert row[1:4] == ["val only", "read", "val"]
    assert (row[5], row[6]) == ("never", f"{expiry:%Y-%m-%d}")


@pytest.mark.parametrize(
    ("fields", "field", "sentence"),
    [
        ({"name": ""}, "name", "The token has no name"),
        ({"scopes": []}, "scopes", "The token has no scope"),
        ({"days": "366"}, "days", "expires after 366 days; expected 1 to 365"),
        ({"days": "soon"}, "days", "not a whole number of days"),
    ],
)
def test_what_is_wrong_stands_at_its_field(
    signed_in: Client, benchmark: None, fields: dict[str, object], field: str, sentence: str
) -> None:
    response = signed_in.post(PAGE, {**FIELDS, **fields})
    assert response.status_code == 422
    assert sentence in assert_sound(response).one("div", id=f"id_{field}_error").text
    assert not ApiToken.objects.exists()


def test_revoking_ends_a_token_at_once(signed_in: Client, owner: User) -> None:
    secret = builders.token(owner)
    form = pages.page(signed_in.get(PAGE)).one("form", action="/tokens/revoke/")
    assert "required" in form.one("input", type="checkbox").attributes  # a slip of the mouse revokes nothing
    data = {"token": form.one("input", name="token").attributes["value"]}
    assert signed_in.post("/tokens/revoke/", data).headers["Location"] == PAGE
    response = APIClient().get("/api/v1/submissions", HTTP_AUTHORIZATION=f"Bearer {secret}")
    assert response.status_code == 401
    assert listed(signed_in)[0][7] == "revoked"


def test_others_tokens_are_neither_seen_nor_revoked(signed_in: Client, stranger: User) -> None:
    builders.token(stranger)
    row = ApiToken.objects.get()
    assert listed(signed_in) == []
    for value in (row.digest, "nonsense", "", "a\x00b"):
        assert signed_in.post("/tokens/revoke/", {"token": value}).status_code == 404
    assert signed_in.get("/tokens/revoke/").status_code == 405
    assert ApiToken.objects.get().revoked_at is None
