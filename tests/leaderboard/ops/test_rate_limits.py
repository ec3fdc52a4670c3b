"""Rates that all web processes count together."""

from datetime import UTC, datetime, timedelta

import pytest
from django.core.cache import caches
from django.db import connection
from django.test import Client
from pytest_django import DjangoAssertNumQueries, Settings

from leaderboard.models import Allowance, CachedValue, User
from leaderboard.ops import rate_limits
from leaderboard.ops.rate_limits import InMemory, Rate
from tests.leaderboard.db.test_races import at_once

NOW_S = 1_800_000_000.0
THREE = Rate(n=3, period_s=60)


def taken(*, at_s: float, who: str = "somebody", rate: Rate = THREE) -> bool:
    return rate_limits.take(who=who, rate=rate, now_s=NOW_S + at_s).is_allowed


def test_so_many_at_once_and_then_one_at_a_time(db: None) -> None:
    assert [taken(at_s=0) for _ in range(4)] == [True, True, True, False]
    assert [taken(at_s=19.9), taken(at_s=20.1), taken(at_s=20.2)] == [False, True, False]
    assert [taken(at_s=200) for _ in range(4)] == [True, True, True, False]


def test_a_refusal_says_when_the_next_is_let_through_and_moves_nothing(db: None) -> None:
    for _ in range(3):
        taken(at_s=0)
    answers = [rate_limits.take(who="somebody", rate=THREE, now_s=NOW_S + at_s) for at_s in (1, 5)]
    assert [round(answer.wait_s, 3) for answer in answers] == [19, 15]
    assert [answer.n_left for answer in answers] == [0, 0]
    assert taken(at_s=20.1)


def test_what_is_left_is_told(db: None) -> None:
    left = [rate_limits.take(who="somebody", rate=THREE, now_s=NOW_S).n_left for _ in range(3)]
    assert left == [2, 1, 0]


def test_people_and_rates_are_counted_apart(db: None) -> None:
    assert [taken(at_s=0, who=f"{n}") for n in range(5)] == [True] * 5


def test_one_statement_counts_a_request(db: None, django_assert_num_queries: DjangoAssertNumQueries) -> None:
    with django_assert_num_queries(1):
        assert taken(at_s=0)


def test_nobody_reads_addresses_out_of_the_table(db: None) -> None:
    taken(at_s=0, who="visitor:203.0.113.9")
    assert "203.0.113.9" not in str(list(Allowance.objects.values()))


def test_what_is_over_is_forgotten(db: None) -> None:
    taken(at_s=0)
    CachedValue.objects.create(
        cache_key="x", value="", expires=datetime.fromtimestamp(NOW_S, tz=UTC) + timedelta(seconds=5)
    )
    assert rate_limits.purge_expired(now_s=NOW_S + 1) == 0
    assert rate_limits.purge_expired(now_s=NOW_S + 30) == 2
    assert not Allowance.objects.exists()


def test_memory_counts_like_the_database(db: None) -> None:
    memory = InMemory()
    for at_s in (0, 0, 0, 0, 19, 21, 22, 45, 300):
        answer = memory.take(who="somebody", rate=THREE, now_s=NOW_S + at_s)
        assert answer == rate_limits.take(who="somebody", rate=THREE, now_s=NOW_S + at_s)
    memory.forget()
    assert memory.take(who="somebody", rate=THREE, now_s=NOW_S).n_left == 2


@pytest.mark.services
@pytest.mark.django_db(transaction=True)
@pytest.mark.skipif("connection.vendor != 'postgresql'", reason="runs with: python -m tests.on_postgresql")
def test_two_processes_cannot_both_take_the_last_place() -> None:
    rate = Rate(n=20, period_s=60)
    found = at_once(100, lambda _: taken(at_s=0, rate=rate))
    assert (found.count(True), len(found)) == (20, 100)


@pytest.mark.skipif("connection.vendor != 'postgresql'", reason="runs with: python -m tests.on_postgresql")
def test_counts_cost_no_write_ahead_log(db: None) -> None:
    with connection.cursor() as cursor:
        cursor.execute("SELECT relpersistence FROM pg_class WHERE relname = 'leaderboard_allowance'")
        assert cursor.fetchone() == ("u",)


# --- signing in ------------------------------------------------------------------------------------------


@pytest.fixture
def shared_cache(settings: Settings) -> None:
    """Production's cache: a table."""
    settings.CACHES = {
        "default": {
            "BACKEND": "django.core.cache.backends.db.DatabaseCache",
            "LOCATION": "leaderboard_cache",
        }
    }


def signing_in(n: int, *, path: str = "/accounts/login/", **headers: str) -> list[int]:
    """What so many wrong passwords for one account are answered, each from another browser."""
    form = {"login": "owner@example.org", "username": "owner@example.org", "password": "wrong"}
    return [Client(**headers).post(path, form).status_code for _ in range(n)]


def test_guessing_a_password_is_counted_in_the_table(shared_cache: None, owner: User) -> None:
    signing_in(6)
    assert CachedValue.objects.exists()
    caches["default"].clear()
    good = {"login": "owner@example.org", "password": "correct horse"}
    assert Client().post("/accounts/login/", good).status_code == 302


def test_after_five_wrong_passwords_the_right_one_is_refused_too(shared_cache: None, owner: User) -> None:
    signing_in(5)
    response = Client().post("/accounts/login/", {"login": "owner@example.org", "password": "correct horse"})
    assert response.status_code == 200
    assert b"Too many failed login attempts" in response.content


@pytest.mark.slow
def test_a_forwarding_header_does_not_help_the_guesser(
    shared_cache: None, db: None, settings: Settings
) -> None:
    # As many as in earnest, in a time that forty requests take on no machine.
    settings.ACCOUNT_RATE_LIMITS = {**settings.ACCOUNT_RATE_LIMITS, "login": "30/h/ip"}
    found = []
    for n in range(40):
        form = {"login": f"somebody{n}@example.org", "password": "wrong"}
        found.append(
            Client().post("/accounts/login/", form, headers={"X-Forwarded-For": f"10.0.0.{n}"}).status_code
        )
    assert found[29:] == [200, *[429] * 10]
