"""The maintainers' pages as their tests read them."""

from django.test import Client

from leaderboard.models import Split
from tests import pages
from tests.leaderboard.web.test_every_page import assert_sound

HUB, OPEN = "/maintain/", "/maintain/test/open/"
FIRST, SECOND = "/maintain/test/editions/1/", "/maintain/test/editions/2/"


def get(client: Client, address: str) -> pages.Element:
    response = client.get(address)
    assert response.status_code == 200, address
    return assert_sound(response)


def main_text(client: Client, address: str) -> str:
    return get(client, address).one("main").text


def board_number() -> int:
    published = Split.objects.get(pk="test").current_edition
    assert published is not None
    return published.number


def refusal(client: Client, address: str, data: dict[str, object]) -> str:
    """Return the errors of a refused form; the board stays at its edition."""
    before = board_number()
    response = client.post(address, data)
    assert response.status_code == 422
    assert board_number() == before
    return assert_sound(response).one("div", class_="form-errors").text


def effects(root: pages.Element) -> list[str]:
    """Return the sentences about what an edition does."""
    return [item.text for item in root.one("ul", class_="consequences").all("li")]
