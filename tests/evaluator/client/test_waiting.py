"""How the API client waits: for scores, for a server that is away, never for what waiting does not cure."""

from __future__ import annotations

import random
from contextlib import ExitStack

import pytest

from evaluator.client.answers import Refused, TimedOut, Unreachable
from evaluator.client.api import Client
from evaluator.client.exchange import RetryPolicy
from tests.evaluator.cli.recorded_site import CUT, RecordedSite, Reply
from tests.evaluator.client.test_client import ONE, QUEUED, SCORED, SUBMISSIONS, send
from tests.evaluator.fake_time import FakeTime
from tests.services import free_port


def test_watch_gives_every_state_until_the_final_one(client: Client, site: RecordedSite) -> None:
    queued = QUEUED | {"queue": {"ahead": 2}}
    site.put(ONE, Reply(queued), Reply(QUEUED | {"state": "RUNNING"}), Reply(SCORED))
    seen = list(client.watch("abc", timeout_s=60))
    assert [submission.state for submission in seen] == ["QUEUED", "RUNNING", "SCORED"]
    assert seen[0].queue is not None
    assert seen[0].queue.ahead == 2


@pytest.mark.slow
def test_watch_asks_less_and_less_often(client: Client, site: RecordedSite, clock: FakeTime) -> None:
    site.put(ONE, *[Reply(QUEUED)] * 12, Reply(SCORED))
    list(client.watch("abc", timeout_s=600))
    assert clock.slept_s[0] <= 0.25
    assert clock.slept_s[8] > 10 * clock.slept_s[0]
    assert max(clock.slept_s) <= 10


def test_watch_outlives_an_absent_and_a_busy_server(
    client: Client, site: RecordedSite, clock: FakeTime
) -> None:
    site.put(
        ONE,
        Reply(fault=CUT),
        Reply(status=502),
        Reply(status=503, headers={"Retry-After": "9"}),
        Reply(SCORED),
    )
    assert [submission.state for submission in client.watch("abc", timeout_s=60)] == ["SCORED"]
    assert clock.slept_s[2] == 9.0


def test_watch_heeds_the_pace_that_a_healthy_server_asks_for(
    client: Client, site: RecordedSite, clock: FakeTime
) -> None:
    site.put(ONE, Reply(QUEUED, headers={"Retry-After": "3"}), Reply(SCORED))
    list(client.watch("abc", timeout_s=60))
    assert clock.slept_s == [3.0]


@pytest.mark.slow
def test_watch_ends_in_time_with_what_it_saw_last(
    client: Client, site: RecordedSite, clock: FakeTime
) -> None:
    site.put(ONE, Reply(QUEUED))
    with pytest.raises(TimedOut) as caught:
        list(client.watch("abc", timeout_s=30))
    assert clock.now_s <= 30
    assert caught.value.submission is not None
    assert caught.value.submission.state == "QUEUED"


def test_watch_does_not_wait_for_what_never_comes(
    client: Client, site: RecordedSite, clock: FakeTime
) -> None:
    site.put(ONE, Reply(status=404))
    with pytest.raises(Refused):
        list(client.watch("abc", timeout_s=30))
    assert clock.slept_s == []


def test_state_of_a_newer_server_is_not_taken_for_a_final_one(client: Client, site: RecordedSite) -> None:
    site.put(ONE, Reply(QUEUED | {"state": "PAUSED"}), Reply(SCORED))
    assert [submission.state for submission in client.watch("abc", timeout_s=60)] == ["PAUSED", "SCORED"]


def test_server_that_has_answered_is_waited_for_when_it_goes_away(clock: FakeTime) -> None:
    with RecordedSite() as site:
        site.put("GET /api/v1/quota", Reply([], headers={"Connection": "close"}))
        client = Client(url=site.url, sleep=clock.sleep, retry_policy=RetryPolicy(n_tries=5))
        assert client.quota() == []
    with client, pytest.raises(Unreachable):
        client.quota()
    assert len(clock.slept_s) == 4, "it may be restarting"


def test_spent_quota_is_never_waited_for_however_soon_it_opens(
    client: Client, site: RecordedSite, clock: FakeTime
) -> None:
    document = {"code": "quota-exceeded", "detail": "Spent."}
    site.put(SUBMISSIONS, Reply(document, status=429, headers={"Retry-After": "1"}))
    with pytest.raises(Refused):
        send(client)
    assert (len(site.requests), clock.slept_s) == (1, [])


def test_busy_server_is_asked_again_within_a_minute(
    client: Client, site: RecordedSite, clock: FakeTime
) -> None:
    throttled = Reply({"code": "throttled"}, status=429, headers={"Retry-After": "55"})
    site.put(SUBMISSIONS, throttled, Reply(QUEUED, status=201))
    send(client)
    assert clock.slept_s == [55.0]


# --- first contact ----------------------------------------------------------------------------------------


def test_server_that_starts_seconds_after_the_job_is_waited_for(clock: FakeTime) -> None:
    """A job and its server, or the network between them, often come up together."""
    url = f"http://127.0.0.1:{free_port()}"
    with ExitStack() as running:

        def sleep(seconds: float) -> None:
            was_s = clock.now_s
            clock.sleep(seconds)
            if was_s < 5 <= clock.now_s:
                site = running.enter_context(RecordedSite(port=int(url.rpartition(":")[2])))
                site.put(ONE, Reply(SCORED))

        with Client(url=url, sleep=sleep, rng=random.Random(0)) as client:
            assert client.submission("abc").is_final
    assert 5 <= clock.now_s < 10
