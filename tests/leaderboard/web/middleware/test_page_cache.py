"""What an address may add to what is remembered: nothing but what its view reads, spelt in one way."""

from datetime import timedelta
from typing import Any

import pytest
from django.http import HttpRequest
from django.http.response import HttpResponseBase
from django.test import Client
from django.utils import timezone

from leaderboard.models import Edition, Method, User
from leaderboard.web.middleware import page_cache
from leaderboard.web.middleware.page_cache import memory
from tests import board_rows

pytestmark = pytest.mark.slow

API = "/api/v1/splits/test/board"
PAGES = ("/", "/board/test/", API, "/board/test.csv", "/board/test/editions/", "/compare/", "/sitemap.xml")


@pytest.fixture
def filled(edition: Edition, owner: User) -> list[Method]:
    memory.clear()
    return board_rows.fill(edition, n=3, user=owner)


def n_remembered() -> int:
    return len(memory.plain) + len(memory.queries)


@pytest.mark.parametrize("page", PAGES)
def test_what_no_view_reads_adds_no_answer_and_stands_in_none(
    page: str, filled: list[Method], client: Client
) -> None:
    plain = client.get(page)
    found = memory.get(page)
    assert (plain.status_code, n_remembered()) == (200, 1)
    for i in range(200):
        assert client.get(f"{page}?utm=made-up-{i}&{i}={i}").content == plain.content
    assert n_remembered() == 1
    assert memory.get(page) is found


def test_the_first_to_ask_writes_nothing_of_theirs_into_the_answer_of_others(
    filled: list[Method], client: Client
) -> None:
    chosen = "&".join(f"m={method.pk}" for method in filled[:2])
    for page in (*PAGES, f"/compare/?split=test&{chosen}"):
        memory.clear()
        sign = "&" if "?" in page else "?"
        assert b"made-up" not in client.get(f"{page}{sign}utm=made-up").content, page


def test_order_duplicates_and_empty_parameters_are_one_address(filled: list[Method], client: Client) -> None:
    wanted = client.get("/board/test/?sort=-mid&nerf=no")
    n_before = n_remembered()
    for query in ("nerf=no&sort=-mid", "sort=rank&sort=-mid&nerf=no", "nerf=no&sort=-mid&q=&frames=&page="):
        assert client.get(f"/board/test/?{query}", follow=True).content == wanted.content
    assert n_remembered() == n_before == 1


def test_what_is_kept_is_answered_under_our_names_alone(
    filled: list[Method], client: Client, settings: Any
) -> None:
    settings.ALLOWED_HOSTS = ["board.example.org"]
    for page in PAGES:
        for _ in range(3):
            assert client.get(page, headers={"Host": "board.example.org"}).status_code == 200
        assert client.get(page, headers={"Host": "rebound.example.org"}).status_code == 400


@pytest.mark.parametrize("place", ["/x", "//evil.example"])
def test_what_says_that_the_site_is_elsewhere_changes_no_answer(
    place: str, filled: list[Method], client: Client
) -> None:
    queries = ("", "?sort=-mid&nerf=no", "?frames=6")
    for address in (*PAGES, *(f"/board/test/{query}" for query in queries)):
        # As a server hands it on that believes such a header of its proxy.
        first = client.get(address, SCRIPT_NAME=place)
        assert first.status_code == 200
        kept = client.get(address).content
        assert first.content == kept, address
        memory.clear()
        assert client.get(address).content == kept, address
        memory.clear()


@pytest.mark.parametrize(
    ("query", "status"),
    [
        ("q=word-{}", 200),
        ("pretraining=word-{}", 200),
        ("hardware=word-{}", 200),
        ("latency=1{}.5", 200),
        ("parameters=1{}", 200),
        ("page=1{}9", 200),
        ("at=2025-01-01T00:00:00.{}", 200),
        ("sort=word-{}", 400),
        ("nerf=word-{}", 400),
        ("frames=1{}", 400),
    ],
)
def test_what_anybody_can_make_up_is_answered_and_not_remembered(
    query: str, status: int, filled: list[Method], client: Client
) -> None:
    found = [client.get(f"/board/test/?{query.format(i)}").status_code for i in range(3)]
    assert (found, n_remembered()) == ([status] * 3, 0)


def test_remembered_of_all_times_are_days_that_are_over(
    filled: list[Method], client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = timezone.now()
    monkeypatch.setattr(timezone, "now", lambda: now)  # no midnight comes between two requests
    over, today, tomorrow = (f"{now + timedelta(days=n):%Y-%m-%d}" for n in (-1, 0, 1))
    for address in ("/board/test/", API, "/board/test.csv"):
        memory.clear()
        first = client.get(f"{address}?at={over}")
        assert n_remembered() == 1
        again = client.get(f"{address}?at={over}", headers={"If-None-Match": first["ETag"]})
        assert (again.status_code, again["ETag"]) == (304, first["ETag"])
        for at in (today, tomorrow, f"{over}T12:00", f"{over[:-2]}99", f"{over[:-2]}٠١"):
            client.get(address, {"at": at})
        assert n_remembered() == 1
    monkeypatch.setattr(timezone, "now", lambda: now + timedelta(days=1))
    assert client.get(f"/board/test/?at={today}").text.count("The board as of") == 1
    assert n_remembered() == 2


def test_the_api_answers_a_query_alike_with_and_without_memory(filled: list[Method], client: Client) -> None:
    assert client.get(API).status_code == 200
    # An empty order is a mistake here, whatever is remembered of the board without one.
    assert client.get(f"{API}?sort=").status_code == 400
    assert client.get(f"{API}?intervals=").status_code == 200
    assert client.get(f"{API}?mine=1").status_code == 200
    assert client.get("/board/test.csv").status_code == 200
    assert client.get("/board/test.csv?mine=1").status_code == 400


def test_answers_to_queries_push_out_no_plain_page(
    filled: list[Method], client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    small = page_cache.ResponseCache(plain_bytes=page_cache.MAX_PLAIN_BYTES, queries_bytes=100_000)
    monkeypatch.setattr(page_cache, "memory", small)
    for page in PAGES:
        client.get(page)
    for sort in ("mid", "-mid", "rte", "-rte", "date", "-date", "team", "-team"):
        for frames in range(2, 7):
            client.get(f"/board/test/?sort={sort}&frames={frames}")
    assert len(small.queries) < 40
    assert [page for page in PAGES if small.get(page) is None] == []


def without_id(response: HttpResponseBase) -> dict[str, str]:
    """The headers, but for the request's id, which no two answers share."""
    assert len(response["X-Request-ID"]) == 36
    return {name: value for name, value in response.items() if name != "X-Request-ID"}


def test_a_repeated_answer_has_every_header_of_one_that_went_through_all_layers(
    filled: list[Method], client: Client, settings: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings.API_RATES = settings.API_RATES | {"visitor": "1000/min"}
    gzipped = {"Accept-Encoding": "gzip"}
    for page in (*PAGES, "/board/test/?sort=-mid"):
        tag = client.get(page, headers=gzipped)["ETag"]
        forms: tuple[dict[str, str], ...] = (
            {},
            gzipped,
            gzipped | {"If-None-Match": tag},
            {"If-None-Match": f'W/{tag}, "else"'},
        )
        through = [client.get(page, headers=form) for form in forms]
        with monkeypatch.context() as inner:
            inner.delattr(page_cache.PageCacheMiddleware, "__call__")
            repeated = [client.get(page, headers=form) for form in forms]
        assert [found.status_code for found in repeated] == [found.status_code for found in through]
        assert [without_id(found) for found in repeated] == [without_id(found) for found in through]
        assert [found.content for found in repeated] == [found.content for found in through]
        # What is left of its first reader's rate is nobody else's.
        assert not any(found.has_header("RateLimit") for found in repeated)


def test_nothing_is_repeated_to_who_says_who_they_are_nor_over_another_scheme(
    filled: list[Method], client: Client, owner: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    for _ in range(3):
        anybodys = client.get("/board/test/", headers={"Accept-Encoding": "gzip"})
    layers: list[str] = []
    asked = page_cache.PageCacheMiddleware.__call__

    def ask(self: page_cache.PageCacheMiddleware, request: HttpRequest) -> HttpResponseBase:
        layers.append(request.path)
        return asked(self, request)

    monkeypatch.setattr(page_cache.PageCacheMiddleware, "__call__", ask)
    assert client.get("/board/test/", headers={"Accept-Encoding": "gzip"}).content == anybodys.content
    assert layers == []
    client.get("/board/test/", secure=True, headers={"Accept-Encoding": "gzip"})
    client.get("/board/test/", headers={"Authorization": "Bearer nothing"})
    client.get("/board/test/", headers={"HX-Request": "true"})
    client.head("/board/test/")
    client.force_login(owner)
    own = client.get("/board/test/", headers={"Accept-Encoding": "gzip"})
    assert len(layers) == 5
    assert own["Cache-Control"] == "private, no-store"
