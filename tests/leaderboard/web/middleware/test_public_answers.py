"""Answers from the cache contain nothing that an address, a host or a reader adds."""

from typing import Any

import pytest
from django.core.cache import caches
from django.db import connection
from django.http.response import HttpResponseBase
from django.test import Client
from django.test.utils import CaptureQueriesContext

from leaderboard.models import Edition, Method, User
from leaderboard.web.middleware.public_answers import KNOWN, PREFIXES
from tests import board_rows
from tests.caching import forget_boards
from tests.openapi import schema

pytestmark = pytest.mark.slow

API = "/api/v1/splits/test/board"
PAGES = ("/", "/board/test/", API, "/board/test.csv", "/board/test/editions/", "/compare/", "/sitemap.xml")


@pytest.fixture
def filled(edition: Edition, owner: User) -> list[Method]:
    return board_rows.fill(edition, n=3, user=owner)


def is_kept(client: Client, address: str, **more: Any) -> bool:
    """Whether it is answered by a question for the number alone."""
    with CaptureQueriesContext(connection) as captured:
        assert client.get(address, **more).status_code == 200
    return len(captured) == 1


@pytest.mark.parametrize("page", PAGES)
def test_what_no_view_reads_adds_no_answer_and_stands_in_none(
    page: str, filled: list[Method], client: Client
) -> None:
    first = client.get(f"{page}?utm=made-up&fbclid=1")
    assert b"made-up" not in first.content
    for i in range(3):
        assert is_kept(client, f"{page}?utm=made-up-{i}&{i}={i}")
        assert client.get(f"{page}?utm=made-up-{i}").content == first.content
    assert is_kept(client, page)


def test_the_first_to_ask_writes_nothing_of_theirs_into_the_answer_of_others(
    filled: list[Method], client: Client
) -> None:
    chosen = "&".join(f"m={method.pk}" for method in filled[:2])
    for page in (*PAGES, f"/compare/?split=test&{chosen}"):
        forget_boards()
        sign = "&" if "?" in page else "?"
        client.get(f"{page}{sign}utm=made-up")
        assert b"made-up" not in client.get(page).content, page


def test_every_parameter_of_what_is_kept_is_known(filled: list[Method]) -> None:
    described = schema()["paths"]
    read = {
        each["name"]
        for path, operations in described.items()
        if path.startswith(PREFIXES) and not path.endswith(("/manifest", "/preview", "/visibility"))
        for each in operations.get("get", {}).get("parameters", ())
        if each["in"] == "query"
    }
    assert {"sort", "at", "limit"} <= read <= KNOWN


def test_the_order_of_an_address_changes_no_answer(filled: list[Method], client: Client) -> None:
    wanted = client.get("/board/test/?sort=-mid&nerf=no")
    assert is_kept(client, "/board/test/?nerf=no&sort=-mid")
    for query in ("nerf=no&sort=-mid", "sort=rank&sort=-mid&nerf=no", "nerf=no&sort=-mid&q=&frames=&page="):
        assert client.get(f"/board/test/?{query}", follow=True).content == wanted.content


def test_what_is_kept_is_answered_under_our_names_alone(
    filled: list[Method], client: Client, settings: Any
) -> None:
    settings.ALLOWED_HOSTS = ["board.example.org"]
    for page in PAGES:
        for _ in range(3):
            assert client.get(page, headers={"Host": "board.example.org"}).status_code == 200
        assert client.get(page, headers={"Host": "rebound.example.org"}).status_code == 400


@pytest.mark.parametrize("prefix", ["/x", "//evil.example"])
def test_what_says_that_the_site_is_elsewhere_changes_no_answer(
    prefix: str, filled: list[Method], client: Client
) -> None:
    queries = ("", "?sort=-mid&nerf=no", "?frames=6")
    for address in (*PAGES, *(f"/board/test/{query}" for query in queries)):
        # As a server hands it on that believes such a header of its proxy.
        first = client.get(address, SCRIPT_NAME=prefix)
        assert first.status_code == 200
        kept = client.get(address).content
        assert first.content == kept, address
        forget_boards()
        assert client.get(address).content == kept, address
        forget_boards()


def test_the_api_answers_a_query_alike_with_and_without_memory(filled: list[Method], client: Client) -> None:
    assert client.get(API).status_code == 200
    # An empty order is a mistake here, whatever is remembered of the board without one.
    assert client.get(f"{API}?sort=").status_code == 400
    assert client.get(f"{API}?intervals=").status_code == 200
    assert client.get(f"{API}?mine=1").status_code == 200
    assert client.get("/board/test.csv").status_code == 200
    assert client.get("/board/test.csv?mine=1").status_code == 400


def without_id(response: HttpResponseBase) -> dict[str, str]:
    """The headers, but for the request's id, which no two answers share."""
    assert len(response["X-Request-ID"]) == 36
    return {name: value for name, value in response.items() if name != "X-Request-ID"}


def test_a_kept_answer_has_every_header_of_the_first_but_what_is_left_of_its_readers_rate(
    filled: list[Method], client: Client, settings: Any
) -> None:
    settings.API_RATES = settings.API_RATES | {"visitor": "1000/min"}
    for page in (*PAGES, "/board/test/?sort=-mid"):
        for form in ({}, {"Accept-Encoding": "gzip"}):
            forget_boards()
            first, then = (client.get(page, headers=form) for _ in range(2))
            assert then.content == first.content
            assert not then.has_header("RateLimit")
            rates = {"RateLimit", "RateLimit-Policy"}
            assert (
                without_id(then).items()
                == {k: v for k, v in without_id(first).items() if k not in rates}.items()
            )


def test_nothing_is_repeated_to_who_says_who_they_are(
    filled: list[Method], client: Client, owner: User
) -> None:
    for _ in range(2):
        anybodys = client.get("/board/test/")
    assert is_kept(client, "/board/test/")
    assert client.get(API, headers={"Authorization": "Bearer nothing"}).status_code == 401
    client.force_login(owner)
    own = client.get("/board/test/")
    assert own["Cache-Control"] == "private, no-store"
    assert own.content != anybodys.content
    assert Client().get("/board/test/").content == anybodys.content


@pytest.mark.parametrize("page", ["/", "/board/test/", "/board/test/?sort=-mid", "/compare/"])
def test_nobody_goes_round_what_is_kept_with_a_made_up_cookie_or_header(
    filled: list[Method], client: Client, page: str
) -> None:
    kept = client.get(page).content
    for cookie in ("sessionid=made-up", "messages=made-up", "messages=W10:1abc:signature"):
        answer = client.get(page, headers={"Cookie": cookie})
        assert answer.content == kept
        assert is_kept(client, page, headers={"Cookie": cookie})
    for header in ({"Authorization": "Basic bWFkZTp1cA=="}, {"HX-Request": "true"}):
        assert is_kept(client, page, headers=header)
    # One that it could be is looked up, and nothing more.
    with CaptureQueriesContext(connection) as asked:
        answer = client.get(page, headers={"Cookie": f"sessionid={'a' * 32}"})
    assert (len(asked), answer.content) == (2, kept)
    assert answer["Cache-Control"] == "private, no-store"


def test_a_message_that_waits_is_shown_to_its_reader_alone(filled: list[Method], client: Client) -> None:
    kept = client.get("/board/test/").content
    client.post("/submit/", {})
    assert client.cookies["messages"].value
    assert b"Your session has ended" in client.get("/board/test/").content
    assert Client().get("/board/test/").content == kept


def test_answers_to_queries_push_out_no_plain_page(
    filled: list[Method], client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(caches["views"], "_max_entries", 4)
    for page in PAGES:
        client.get(page)
    for word in range(10):
        assert client.get(f"/board/test/?q=word-{word}").status_code == 200
    assert not is_kept(client, "/board/test/?q=word-0")
    assert [page for page in PAGES if not is_kept(client, page)] == []
