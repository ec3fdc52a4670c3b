"""Rate limits per account or address, and the answers beyond them."""

from datetime import UTC, datetime, timedelta

import pytest
from django.core.cache import cache
from django.test import Client
from pytest_django import Settings

from leaderboard.models import CachedValue, User
from leaderboard.ops import rate_limits

NOW_S = 1_800_000_000.0


class Sent(rate_limits.Throttle):
    """Three a minute, of whom it is given."""

    scope = "sent"
    clock_s = NOW_S

    def timer(self) -> float:
        return self.clock_s

    def identity(self, request: object) -> object | None:
        return request


class Together(Sent):
    """The same, counted by all processes."""

    cache = cache


@pytest.fixture(autouse=True)
def rates(settings: Settings) -> None:
    settings.API_RATES = {**settings.API_RATES, "sent": "3/min"}
    rate_limits.IN_PROCESS.clear()
    cache.clear()


def taken(*, at_s: float, who: str = "somebody", kind: type[Sent] = Sent) -> Sent | None:
    """The throttle, if it lets the request through."""
    throttle = kind()
    throttle.clock_s = NOW_S + at_s
    return throttle if throttle.allow_request(who) else None


@pytest.mark.parametrize("kind", [Sent, Together])
def test_so_many_in_any_minute(kind: type[Sent]) -> None:
    moments = (0, 0, 20, 59, 61, 62, 79, 81)
    assert [taken(at_s=at_s, kind=kind) is not None for at_s in moments] == [
        *(True, True, True, False),
        *(True, True, False, True),
    ]


def test_a_refusal_says_when_the_next_is_let_through_and_counts_nothing() -> None:
    for _ in range(3):
        taken(at_s=0)
    refused = Sent()
    for at_s in (1, 41):
        refused.clock_s = NOW_S + at_s
        assert not refused.allow_request("somebody")
        assert (refused.wait_s, refused.n_left) == (60 - at_s, 0)
    assert taken(at_s=60)


def test_people_and_rates_are_counted_apart() -> None:
    assert all(taken(at_s=0, who=f"{n}") for n in range(5))
    assert all(taken(at_s=0, kind=kind) for kind in (Sent, Together) for _ in range(3))


def test_what_is_sent_is_counted_by_all_processes_and_under_no_address(db: None, shared_cache: None) -> None:
    assert taken(at_s=0, who="203.0.113.9", kind=Together)
    [row] = CachedValue.objects.values()
    assert "203.0.113.9" not in str(row)


def test_what_is_over_is_forgotten(db: None) -> None:
    now = datetime.fromtimestamp(NOW_S, tz=UTC)
    CachedValue.objects.create(cache_key="x", value="", expires=now + timedelta(seconds=5))
    assert rate_limits.purge_expired(now=now + timedelta(seconds=1)) == 0
    assert rate_limits.purge_expired(now=now + timedelta(seconds=30)) == 1


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
    """Statuses of n sign-ins with a wrong password for one account, each from another browser."""
    form = {"login": "owner@example.org", "username": "owner@example.org", "password": "wrong"}
    return [Client(**headers).post(path, form).status_code for _ in range(n)]


def test_after_five_wrong_passwords_the_right_one_is_refused_too(shared_cache: None, owner: User) -> None:
    signing_in(5)
    response = Client().post("/accounts/login/", {"login": "owner@example.org", "password": "correct horse"})
    assert response.status_code == 200
    assert b"Too many failed sign-ins. Try again in 5 minutes" in response.content


@pytest.mark.slow
def test_after_twenty_sign_ins_with_the_right_password_one_account_waits_and_others_do_not(
    shared_cache: None, owner: User, stranger: User, settings: Settings
) -> None:
    # Without the limit for all accounts of an address, which as many would reach.
    settings.ACCOUNT_RATE_LIMITS = {**settings.ACCOUNT_RATE_LIMITS, "login": None}

    def answer(user: User, **environment: str) -> tuple[int, bytes]:
        form = {"login": user.email, "password": "correct horse"}
        response = Client(**environment).post("/accounts/login/", form)
        return response.status_code, response.content

    assert [answer(owner)[0] for _ in range(20)] == [302] * 20
    status, page = answer(owner)
    assert status == 200
    assert b"Too many sign-ins. Try again in 5 minutes." in page
    assert answer(stranger)[0] == 302
    # Whoever does this at one address keeps the account out of no other one.
    assert answer(owner, REMOTE_ADDR="203.0.113.9")[0] == 302


@pytest.mark.slow
def test_a_forwarding_header_does_not_help_the_guesser(
    shared_cache: None, db: None, settings: Settings
) -> None:
    # As many as in production, in a window that is longer than forty requests take.
    settings.ACCOUNT_RATE_LIMITS = {**settings.ACCOUNT_RATE_LIMITS, "login": "30/h/ip"}
    statuses = []
    for n in range(40):
        form = {"login": f"somebody{n}@example.org", "password": "wrong"}
        statuses.append(
            Client().post("/accounts/login/", form, headers={"X-Forwarded-For": f"10.0.0.{n}"}).status_code
        )
    assert statuses[29:] == [200, *[429] * 10]
