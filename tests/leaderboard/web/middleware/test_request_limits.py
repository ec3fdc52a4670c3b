"""How often one may send and draw pages: the same rates, counts and words as the API's."""

from pathlib import Path

import pytest
from django.core.cache import cache
from django.core.files.base import ContentFile
from django.test import Client
from pytest_django import Settings

from leaderboard.management.commands import demo
from leaderboard.models import Edition, User
from leaderboard.ops import rate_limits
from tests import pages
from tests.leaderboard.api.test_submissions import client_of

ATTACKER, ELSEWHERE = "203.0.113.9", "192.0.2.3"


@pytest.fixture(autouse=True)
def rates(settings: Settings, benchmark: None) -> None:
    """Three of everything, counted from nothing: the next comes after longer than any test takes."""
    cache.clear()
    rate_limits.IN_PROCESS.clear()
    rates = {"send": "3/hour", "draw": "3/hour", "as_of": "1/hour", "search": "2/hour"}
    settings.PAGE_RATES = settings.PAGE_RATES | rates


def signed_in(user: User) -> Client:
    client = Client()
    client.force_login(user)
    return client


def test_one_page_too_many_is_refused_in_words_with_a_time_and_a_way_back(
    owner: User, settings: Settings
) -> None:
    settings.SITE_URL = "http://testserver"
    client = signed_in(owner)
    statuses = [
        client.post("/tokens/", {"name": f"token {n}", "scope": "read"}).status_code for n in range(3)
    ]
    assert 429 not in statuses
    refused = client.post("/tokens/", {"name": "one too many"}, HTTP_REFERER="http://testserver/tokens/?a=b")
    assert refused.status_code == 429
    assert 1 <= int(refused.headers["Retry-After"]) <= 3600
    main = pages.page(refused).one("main")
    assert main.text.startswith("Too many requests")
    assert "Too many requests in a short time; try again in " in main.text
    assert "Nothing was changed" in main.text
    assert [link.attributes["href"] for link in main.all("a")] == ["/tokens/?a=b", "/board/"]


@pytest.mark.parametrize("address", ["https://evil.example/", "http://testserver//evil.example/"])
def test_a_way_back_leads_to_no_other_site(owner: User, settings: Settings, address: str) -> None:
    settings.SITE_URL = "http://testserver"
    client = signed_in(owner)
    for _ in range(4):
        refused = client.post("/tokens/", {}, HTTP_REFERER=address)
    assert refused.status_code == 429
    assert b"evil.example" not in refused.content


def test_an_account_is_counted_wherever_it_sends_from_and_no_other_with_it(
    owner: User, stranger: User
) -> None:
    client = signed_in(owner)
    statuses = [client.post("/tokens/", {}, REMOTE_ADDR=f"192.0.2.{n}").status_code for n in range(4)]
    assert statuses[-1] == 429
    assert 429 not in statuses[:3]
    assert signed_in(stranger).post("/tokens/", {}).status_code != 429


@pytest.mark.slow
def test_boards_answered_from_memory_are_not_counted_and_others_are(edition: Edition) -> None:
    visitor = Client(REMOTE_ADDR=ATTACKER)
    assert {visitor.get("/board/test/").status_code for _ in range(10)} == {200}
    statuses = [visitor.get(f"/board/test/?q={n}").status_code for n in range(5)]
    assert statuses == [200, 200, 429, 429, 429]
    assert Client(REMOTE_ADDR=ELSEWHERE).get("/board/test/?q=1").status_code == 200
    # What is remembered goes on being answered.
    assert visitor.get("/board/test/").status_code == 200


@pytest.mark.slow
def test_boards_as_of_a_time_have_a_rate_of_their_own_unless_answered_from_memory(edition: Edition) -> None:
    visitor = Client(REMOTE_ADDR=ATTACKER)
    moment, day = "/board/test/?at=2026-01-02T12:00:00Z", "/board/test/?at=2026-01-02"
    assert [visitor.get(moment).status_code for _ in range(2)] == [200, 429]
    assert visitor.get("/board/test/?q=1").status_code == 200
    assert [Client(REMOTE_ADDR=ELSEWHERE).get(day).status_code for _ in range(3)] == [200] * 3
    assert visitor.get(day).status_code == 200


@pytest.mark.slow
def test_searches_have_a_rate_of_their_own_and_the_empty_page_does_not_count() -> None:
    visitor = Client(REMOTE_ADDR=ATTACKER)
    assert visitor.get("/docs/search/").status_code == 200
    assert visitor.get("/docs/search/?q=").status_code == 200
    rate_limits.IN_PROCESS.clear()
    assert [visitor.get(f"/docs/search/?q=quota{n}").status_code for n in range(3)] == [200, 200, 429]
    assert Client(REMOTE_ADDR=ELSEWHERE).get("/docs/search/?q=quota").status_code == 200


def test_too_large_a_file_is_refused_with_the_limit_and_with_gzip_in_the_form_of_its_address(
    owner: User, settings: Settings
) -> None:
    settings.MAX_PREDICTIONS_BYTES = 2_000_000
    first, second = (ContentFile(b" " * 2_200_000, name="predictions.json") for _ in range(2))
    problem = client_of(owner).post("/api/v1/submissions", {"file": first}, format="multipart")
    page = signed_in(owner).post("/submit/", {"file": second})
    assert (problem.status_code, page.status_code) == (413, 413)
    assert (problem["Content-Type"], problem.json()["code"]) == ("application/problem+json", "too-large")
    for text in (problem.json()["detail"], page.text):
        assert "expected at most 2 MB" in text.replace("\u00a0", " ")
        assert "gzip" in text


def test_the_server_of_the_demo_leaves_it_to_the_site_to_refuse_a_large_file(
    settings: Settings, tmp_path: Path
) -> None:
    settings.DATA_DIR = tmp_path
    web, _ = demo.processes("127.0.0.1", 8000, address="http://127.0.0.1:8000")
    [most] = [part.partition("=")[2] for part in web.command if part.startswith("--max-request-body-size=")]
    assert int(most) > 2 * settings.MAX_PREDICTIONS_BYTES


@pytest.mark.slow
def test_monitoring_and_the_api_are_not_counted_as_pages(owner: User) -> None:
    client = client_of(owner)
    assert {Client().get("/healthz").status_code for _ in range(6)} == {200}
    assert {client.get("/api/v1/quota").status_code for _ in range(6)} == {200}
