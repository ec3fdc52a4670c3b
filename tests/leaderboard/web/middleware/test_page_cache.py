"""What an address may add to what is remembered: nothing but what its view reads, spelt in one way."""

from datetime import timedelta

import pytest
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
