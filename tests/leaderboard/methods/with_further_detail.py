"""What follows from one row of the registry; `test_further_detail.py` runs this with a row more."""

import json

import pytest
from django.test import Client
from django.utils import timezone

from leaderboard.methods import editing
from leaderboard.models import Edition, Method, User, Visibility
from tests import builders, openapi, pages

BOARD, API = "/board/test/", "/api/v1/splits/test/board"


@pytest.fixture
def method(edition: Edition, owner: User) -> Method:
    """A scored public method that states the detail."""
    sent = builders.submit(owner, builders.predictions(edition, factor=1.2), method="Foo")
    builders.score_all()
    return editing.edit(method=sent.method, changes={"mascot": "Larksgrad"}, actor=owner)


def test_the_form_asks_for_it_and_the_method_page_shows_it(
    client: Client, method: Method, owner: User
) -> None:
    client.force_login(owner)
    address = f"/methods/{method.pk}/edit/"
    form = pages.page(client.get(address)).one("form", class_="fields")
    assert form.one("label", **{"for": "id_mascot"}).text == "Mascot"
    typed = form.one("input", id="id_mascot").attributes
    assert (typed["value"], typed["maxlength"]) == ("Larksgrad", "40")
    refused = client.post(address, {"mascot": "x" * 41})
    assert "The field 'mascot' has 41 characters; expected at most 40." in refused.content.decode().replace(
        "&#x27;", "'"
    )
    assert client.post(address, {"mascot": "Larks' own"}).status_code == 302
    client.logout()
    assert "Mascot: Larks' own" in pages.page(client.get(f"/methods/{method.pk}/")).one("main").text


def test_programs_read_it_and_change_it(client: Client, method: Method, owner: User) -> None:
    address = f"/api/v1/methods/{method.pk}"
    assert client.get(address).json()["details"]["mascot"] == "Larksgrad"
    response = client.patch(
        address,
        json.dumps({"mascot": None}),
        content_type="application/json",
        headers={"Authorization": f"Bearer {builders.token(owner)}"},
    )
    assert response.json()["details"]["mascot"] == ""


@pytest.mark.usefixtures("method")
def test_boards_are_filtered_by_it_and_exported_with_it(client: Client) -> None:
    root = pages.page(client.get(f"{BOARD}?mascot=LARKS"))
    [row] = root.one("table", class_="board").one("tbody").all("tr")
    shown = row.one("th", class_="method")
    assert (shown.one("a").text, shown.one("span", class_="team").text) == ("Foo", "Owls")
    chooser = root.one("input", id="by-mascot").attributes
    assert (chooser["value"], chooser["placeholder"]) == ("LARKS", "Owl")
    assert root.one("label", **{"for": "by-mascot"}).text == "Mascot contains"
    assert [entry["method"] for entry in client.get(f"{API}?mascot=grad").json()["entries"]] == ["Foo"]
    assert client.get(f"{API}?mascot=owl").json()["entries"] == []
    header, line = client.get("/board/test.csv?mascot=larks").content.decode().splitlines()
    assert dict(zip(header.split(","), line.split(","), strict=True))["mascot"] == '"Larksgrad"'


def test_the_schema_describes_it() -> None:
    schema = openapi.schema()
    for shape in ("Details", "PatchedMethodChangesRequest"):
        field = schema["components"]["schemas"][shape]["properties"]["mascot"]
        assert field["description"].startswith("What the team calls the network.")
    parameters = schema["paths"]["/api/v1/splits/{split}/board"]["get"]["parameters"]
    assert "mascot" in [each["name"] for each in parameters]


def test_nobody_reads_it_of_an_anonymous_method(client: Client, method: Method, owner: User) -> None:
    Method.objects.update(visibility=Visibility.ANONYMOUS)
    builders.board_changed("test")
    then = f"?at={timezone.now():%Y-%m-%dT%H:%M:%S.%fZ}"
    pages_of_it = [f"/methods/{method.pk}/", f"/api/v1/methods/{method.pk}", "/"]
    boards = [f"{path}{query}" for path in (BOARD, API, "/board/test.csv") for query in ("", then)]
    others = ["/board/test.tex", "/board/test.md"]
    for address in (*pages_of_it, *boards, *others):
        answer = client.get(address)
        assert answer.status_code == 200, address
        assert method.pseudonym in answer.content.decode(), address
        assert "larks" not in answer.content.decode().lower(), address
    assert client.get(f"{API}?mascot=larks").json()["entries"] == []
    client.force_login(owner)
    assert "Larksgrad" in client.get(f"/methods/{method.pk}/").content.decode()
