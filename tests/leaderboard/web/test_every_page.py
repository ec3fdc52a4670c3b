"""What holds on every page: one head line, a language, nothing inline, nothing from elsewhere."""

import json
import re
from uuid import UUID

import pytest
from django.contrib.staticfiles import finders
from django.http import HttpResponseBase
from django.test import Client
from django.test.utils import override_settings
from pytest_django import Settings

from evaluator.problems import PROBLEM_CODES
from leaderboard.models import Edition, User
from leaderboard.pages.texts import PAGES
from tests import builders, pages

PUBLIC = [
    "/",
    "/board/test/",
    "/board/val/",
    "/board/demo/",
    "/board/",
    "/published/",
    "/docs/",
    "/docs/api/",
    "/docs/overview/",
    "/docs/baselines/",
    "/docs/architecture/",
    "/docs/decisions/",
    "/docs/search/",
    "/docs/search/?q=quota",
    *(f"/{name}/" for name in PAGES),
    "/accounts/login/",
    "/accounts/login/?next=/submit/",
    "/accounts/signup/",
    "/accounts/password/reset/",
    "/accounts/password/reset/done/",
    "/accounts/password/reset/key/1-set-password/",
    "/accounts/password/reset/key/done/",
    "/accounts/confirm-email/",
    "/accounts/confirm-email/nonsense/",
    "/accounts/inactive/",
]
PRIVATE = [
    "/submit/",
    "/submissions/",
    "/tokens/",
    "/mails/",
    "/accounts/email/",
    "/accounts/password/change/",
    "/accounts/logout/",
    "/accounts/reauthenticate/",
]
FAULTS = {
    "/nowhere/": 404,
    "/board/nowhere/": 404,
    "/board/test/?sort=nowhere": 400,
    f"/methods/{UUID(int=1)}/": 404,
}
# Elements whose text is read by a machine, and attributes that run or style something in place.
INLINE_TAGS = {"style"}
DATA = {"application/json", "application/ld+json"}
INLINE_ATTRIBUTES = re.compile(r"^(on\w+|style)$")
# Links that browsers follow only when somebody asks them to, and the part of the page to wait for.
LEADING_ON = {"canonical", "alternate", "expect"}
# Of this site, or within the page itself, as the code that phones scan.
OWN = re.compile(r"/(?!/)|data:image/svg\+xml;base64,")


def assert_sound(response: HttpResponseBase) -> pages.Element:
    """The claims that hold on every page."""
    assert response.headers["Content-Type"] == "text/html; charset=utf-8"
    root = pages.page(response)
    html = root.one("html")
    assert html.attributes["lang"] == "en-GB"
    title = html.one("head").one("title").text
    assert title.endswith("· TSTTC leaderboard")
    assert len(title) > len("· TSTTC leaderboard") + 2
    assert len(html.all("h1")) == 1
    assert html.one("h1").text
    assert len(html.all("main")) == 1
    assert html.all("meta", name="viewport")
    assert_nothing_inline(html)
    assert_nothing_from_elsewhere(html)
    assert_every_field_has_a_label(html)
    ids = [e.attributes["id"] for e in html.everything() if "id" in e.attributes]
    assert len(ids) == len(set(ids)), sorted(i for i in ids if ids.count(i) > 1)
    assert_links_within_the_page_lead_somewhere(html, ids)
    described = {i for e in html.everything() for i in e.attributes.get("aria-describedby", "").split()}
    assert described <= set(ids)
    return root


def assert_nothing_inline(html: pages.Element) -> None:
    for element in html.everything():
        assert element.tag not in INLINE_TAGS
        assert not [name for name in element.attributes if INLINE_ATTRIBUTES.match(name)], element
        if is_data(element):
            json.loads(element.raw_text)
        elif element.tag == "script":
            assert element.text == ""
            assert "src" in element.attributes


def is_data(element: pages.Element) -> bool:
    """Whether it holds data for a script, which no browser runs."""
    return element.tag == "script" and element.attributes.get("type") in DATA


def assert_nothing_from_elsewhere(html: pages.Element) -> None:
    for element in html.everything():
        if (element.tag in {"script", "img", "iframe", "source"} and not is_data(element)) or (
            element.tag == "link" and element.attributes["rel"] not in LEADING_ON
        ):
            names = ("src", "srcset", "href")
            address = next((value for name in names if (value := element.attributes.get(name))), "")
            assert OWN.match(address), element
            if not address.startswith(("/methods/", "data:")):  # a badge is drawn, and no file
                assert finders.find(address.removeprefix("/static/")), f"{address} is no static file"


def assert_every_field_has_a_label(html: pages.Element) -> None:
    labelled = {label.attributes.get("for") for label in html.all("label")}
    wrapped = [field for label in html.all("label") for field in label.all("input")]
    for tag in ("input", "textarea", "select"):
        for field in html.all(tag):
            if field.attributes.get("type") != "hidden" and field not in wrapped:
                is_named = bool(field.attributes.get("aria-label"))
                assert is_named or field.attributes["id"] in labelled, field


def assert_links_within_the_page_lead_somewhere(html: pages.Element, ids: list[str]) -> None:
    for link in html.all("a"):
        address = link.attributes["href"]
        assert address.split(":")[0] in {"http", "https", "mailto"} or address[0] in "/?#", link
        if address.startswith("#"):
            assert address[1:] in ids, link


@pytest.mark.slow
@pytest.mark.parametrize("address", PUBLIC)
def test_public_pages_are_sound(client: Client, edition: Edition, address: str) -> None:
    response = client.get(address, follow=True)
    assert response.status_code == 200
    assert_sound(response)


@pytest.mark.slow
@pytest.mark.parametrize("address", PRIVATE)
def test_private_pages_are_sound(client: Client, edition: Edition, owner: User, address: str) -> None:
    client.force_login(owner)
    response = client.get(address, follow=True)
    assert response.status_code == 200
    assert_sound(response)


@pytest.mark.parametrize(("address", "status"), FAULTS.items())
def test_pages_of_faults_are_sound(client: Client, benchmark: None, address: str, status: int) -> None:
    response = client.get(address)
    assert response.status_code == status
    assert_sound(response)


@pytest.mark.parametrize(
    ("referer", "back"),
    [
        ("https://board.example.org/board/test/?q=net&frames=6", ["/board/test/?q=net&frames=6"]),
        ("https://board.example.org//elsewhere.example/", []),
        ("https://elsewhere.example/board/test/", []),
    ],
)
def test_a_page_of_a_fault_leads_back_to_where_one_was_with_its_filters(
    client: Client, benchmark: None, settings: Settings, referer: str, back: list[str]
) -> None:
    settings.SITE_URL = "https://board.example.org"
    boards = ["/", "/board/test/", "/board/val/", "/board/demo/"]
    main = pages.get(client, "/nowhere/", 404).one("main")
    assert [a.attributes["href"] for a in main.all("a")] == boards
    root = assert_sound(client.get("/nowhere/", headers={"Referer": referer}))
    assert [a.attributes["href"] for a in root.one("main").all("a")] == [*boards, *back]


@pytest.mark.slow
def test_pages_of_a_submissions_life_are_sound(client: Client, edition: Edition, owner: User) -> None:
    client.force_login(owner)
    good = builders.submit(owner, builders.predictions(edition), note="a remark", commit="abc123")
    bad = builders.submit(owner, b'{"0": 0}')
    waiting = client.get(f"/submissions/{good.pk}/")
    builders.score_all()
    for response in (
        waiting,
        client.get(f"/submissions/{good.pk}/"),
        client.get(f"/submissions/{bad.pk}/"),
        client.get(f"/methods/{good.method_id}/"),
        client.get("/"),
        client.get("/submissions/"),
        client.post("/submit/", {}),
    ):
        assert_sound(response)


@override_settings(DEBUG=False)
def test_failure_of_the_server_is_answered_with_that_page(
    client: Client, benchmark: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(**_: object) -> None:
        raise RuntimeError("a secret detail")

    monkeypatch.setattr("leaderboard.boards.snapshots.board", fail)
    client.raise_request_exception = False
    response = client.get("/")
    assert response.status_code == 500
    assert b"Something went wrong on our side" in response.content
    assert b"secret detail" not in response.content


def test_documentation_names_every_problem_of_a_prediction_file(client: Client, benchmark: None) -> None:
    (link,) = pages.page(client.get("/docs/")).all("a", href="/docs/file-format/#problems")
    guide = pages.page(client.get(link.attributes["href"].partition("#")[0]))
    assert set(PROBLEM_CODES) <= {code.text for code in guide.all("code")}
