"""Rates of requests per account or address, which no header of the client changes."""

from typing import Any

import pytest
from django.core.cache import cache
from django.utils import timezone
from pytest_django import Settings
from rest_framework.test import APIClient

from leaderboard.models import ApiToken, Edition, User
from leaderboard.ops import rate_limits
from tests import builders
from tests.leaderboard.api.test_submissions import client_of, post
from tests.leaderboard.people.test_tokens import client_with

# As of a time: the present board is answered from memory, which is counted nowhere.
BOARD = "/api/v1/splits/test/board?at=2026-01-01T00:00:00Z"
REVOKE = "/api/v1/tokens/revoke"
NEXT_S = 3600


@pytest.fixture(autouse=True)
def rates(settings: Settings) -> None:
    """Three of everything, counted from nothing: the next comes after longer than any test takes."""
    cache.clear()
    rate_limits.IN_PROCESS.clear()
    settings.API_RATES = dict.fromkeys(settings.API_RATES, "3/hour")


def behind(settings: Settings, n_proxies: int) -> None:
    settings.REST_FRAMEWORK = {**settings.REST_FRAMEWORK, "NUM_PROXIES": n_proxies}


def statuses(client: APIClient, address: str = BOARD, *, n: int = 4, **headers: Any) -> list[int]:
    return [client.get(address, **headers).status_code for _ in range(n)]


def test_one_too_many_is_a_429_that_says_when_to_come_back(edition: Edition) -> None:
    assert statuses(APIClient(), n=3) == [200, 200, 200]
    response = APIClient().get(BOARD)
    body = response.json()
    assert (response.status_code, body["code"]) == (429, "throttled")
    assert response.headers["Content-Type"] == "application/problem+json"
    assert 1 <= int(response.headers["Retry-After"]) <= NEXT_S
    assert body["detail"].startswith("Too many requests in a short time; try again in ")


def test_a_forwarding_header_does_not_change_who_is_counted(edition: Edition) -> None:
    client = APIClient()
    statuses = [
        client.get(BOARD, HTTP_X_FORWARDED_FOR=f"10.0.0.{n}", HTTP_FORWARDED=f"for=10.0.0.{n}").status_code
        for n in range(5)
    ]
    assert statuses == [200, 200, 200, 429, 429]


def test_behind_a_proxy_what_it_wrote_counts_and_nothing_before_it(
    edition: Edition, settings: Settings
) -> None:
    behind(settings, 1)
    client = APIClient()
    spoofed = [client.get(BOARD, HTTP_X_FORWARDED_FOR=f"10.0.0.{n}, 192.0.2.7").status_code for n in range(4)]
    assert spoofed == [200, 200, 200, 429]
    assert client.get(BOARD, HTTP_X_FORWARDED_FOR="192.0.2.8").status_code == 200


def test_addresses_of_one_ipv6_network_count_as_one(edition: Edition) -> None:
    statuses = [APIClient(REMOTE_ADDR=f"2001:db8::{n:x}").get(BOARD).status_code for n in range(1, 5)]
    assert statuses == [200, 200, 200, 429]
    assert APIClient(REMOTE_ADDR="2001:db8:0:1::1").get(BOARD).status_code == 200


def test_an_account_is_counted_whatever_its_token_and_address(
    edition: Edition, owner: User, stranger: User
) -> None:
    statuses = [client_of(owner).get(BOARD, REMOTE_ADDR=f"192.0.2.{n}").status_code for n in range(4)]
    assert statuses == [200, 200, 200, 429]
    assert client_of(stranger).get(BOARD).status_code == 200
    assert APIClient().get(BOARD).status_code == 200


@pytest.mark.slow
def test_files_have_a_rate_of_their_own(edition: Edition, owner: User, settings: Settings) -> None:
    settings.API_RATES = {**settings.API_RATES, "signed_in": None}
    client = client_of(owner)
    data = builders.predictions(edition)
    assert [post(client, data).status_code for _ in range(4)] == [201, 200, 200, 429]
    assert statuses(client, "/api/v1/submissions") == [200] * 4


@pytest.mark.slow
def test_boards_as_of_a_time_have_a_rate_of_their_own(
    edition: Edition, owner: User, settings: Settings
) -> None:
    settings.API_RATES = dict.fromkeys(settings.API_RATES) | {"as_of": "1/hour"}
    for client in (APIClient(), client_of(owner)):
        assert statuses(client, n=2) == [200, 429]
        assert statuses(client, "/api/v1/splits/test/board?q=x") == [200] * 4
    # A day that is over is answered from memory, when somebody has asked for it.
    statuses(APIClient(REMOTE_ADDR="192.0.2.9"), "/api/v1/splits/test/board?at=2026-01-01", n=1)
    assert statuses(APIClient(), "/api/v1/splits/test/board?at=2026-01-01") == [200] * 4


def test_reports_of_leaked_tokens_are_throttled(db: None) -> None:
    statuses = [
        APIClient()
        .post(REVOKE, {"token": "x"}, format="json", HTTP_X_FORWARDED_FOR=f"10.0.0.{n}")
        .status_code
        for n in range(4)
    ]
    assert statuses == [200, 200, 200, 429]


@pytest.mark.parametrize("address", ["", "unix:"])
def test_a_connection_without_an_address_is_counted_too(edition: Edition, address: str) -> None:
    assert statuses(APIClient(REMOTE_ADDR=address)) == [200, 200, 200, 429]


# --- requests that open nothing --------------------------------------------------------------------------

MINE = "/api/v1/submissions"


@pytest.mark.parametrize("secret", ["nonsense", "tsttc_" + "0" * 64])
def test_tokens_that_open_nothing_are_throttled_by_address(edition: Edition, secret: str) -> None:
    client = client_with(secret)
    assert statuses(client, MINE) == [401, 401, 401, 429]
    spoofed = client.get(MINE, HTTP_X_FORWARDED_FOR="10.0.0.1")
    assert (spoofed.status_code, spoofed.json()["code"]) == (429, "throttled")
    assert 1 <= int(spoofed.headers["Retry-After"]) <= NEXT_S
    assert client.get(MINE, REMOTE_ADDR="192.0.2.9").status_code == 401


def test_expired_revoked_and_insufficient_tokens_are_throttled_too(edition: Edition, owner: User) -> None:
    expired, revoked = builders.token(owner), builders.token(owner)
    for secret, change in ((expired, {"expiry": timezone.now()}), (revoked, {"revoked_at": timezone.now()})):
        ApiToken.objects.filter(token_key=secret[:15]).update(**change)
    clients = [client_with(secret) for secret in (expired, revoked, builders.token(owner, scopes=["submit"]))]
    assert [client.get(MINE).status_code for client in clients] == [401, 401, 403]
    assert [client.get(MINE).status_code for client in clients] == [429, 429, 429]
    # Whoever has a good one is counted by account, not by this address.
    assert client_of(owner).get(MINE).status_code == 200
