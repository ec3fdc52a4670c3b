"""Waiting for a submission: until it is final, never for long, and at nobody's cost."""

import random
import socket
import threading
from collections.abc import Collection, Iterator
from uuid import UUID, uuid4

import pytest
from django.db import DatabaseError, connection
from pytest_django import Settings
from rest_framework.test import APIClient

from leaderboard.api.submission_views import _is_gone
from leaderboard.models import Edition, Submission, User
from leaderboard.submissions import long_poll
from tests import builders
from tests.leaderboard.api.test_submissions import client_of
from tests.leaderboard.scoring.test_lifecycle_races import at_once

pytestmark = pytest.mark.slow

RNG = random.Random(0)
PATIENCE_S = 180
WAIT_S = 3 * PATIENCE_S  # whoever waits so long has not been let go


def stays() -> bool:
    return False


class Looks:
    """What a watcher asks, instead of a database: counts questions, and says what is final."""

    def __init__(self) -> None:
        self.asked: list[set[UUID]] = []
        self.final: set[UUID] = set()
        self.fault: Exception | None = None
        self.was_asked = threading.Semaphore(0)

    def __call__(self, ids: Collection[UUID]) -> set[UUID]:
        self.asked.append(set(ids))
        self.was_asked.release()
        if self.fault:
            raise self.fault
        return self.final & set(ids)


class Waiter(threading.Thread):
    """Somebody who waits for a submission; `is_held` is what they were told."""

    def __init__(self, watcher: long_poll.Watcher, *, is_gone=stays) -> None:
        super().__init__(daemon=True)
        self.watcher, self.is_gone = watcher, is_gone
        self.submission_id = uuid4()
        self.is_held: bool | None = None
        self.start()

    def run(self) -> None:
        self.is_held = self.watcher.hold(self.submission_id, wait_s=WAIT_S, is_gone=self.is_gone)

    def has_come_back(self) -> bool:
        self.join(PATIENCE_S)
        return not self.is_alive()


@pytest.fixture
def looks() -> Looks:
    return Looks()


def ended() -> None:
    """Once no watcher runs any more: what one does, or raises, belongs to the test that started it."""
    for thread in threading.enumerate():
        if thread.name == "watcher":
            thread._started.wait(PATIENCE_S)  # type: ignore[attr-defined]
            thread.join(PATIENCE_S)
            assert not thread.is_alive(), "nobody waits, and a watcher goes on"


@pytest.fixture
def watcher(looks: Looks) -> Iterator[long_poll.Watcher]:
    made = long_poll.Watcher(look=looks, n_places=lambda: 3, every_s=0.01)
    yield made
    made.close()
    ended()


def seated(watcher: long_poll.Watcher, looks: Looks, n: int, **options) -> list[Waiter]:
    """So many waiters, once the watcher looks for all of them."""
    waiters = [Waiter(watcher, **options) for _ in range(n)]
    while not looks.asked or len(looks.asked[-1]) < n:
        assert looks.was_asked.acquire(timeout=PATIENCE_S)
    return waiters


def test_one_watcher_asks_for_all_and_lets_each_go_when_its_own_is_final(
    watcher: long_poll.Watcher, looks: Looks
) -> None:
    before = set(threading.enumerate())
    first, second, third = seated(watcher, looks, 3)
    started = set(threading.enumerate()) - before
    assert sum(thread.name == "watcher" for thread in started) == 1
    assert looks.asked[-1] == {first.submission_id, second.submission_id, third.submission_id}
    looks.final = {second.submission_id}
    assert second.has_come_back()
    assert second.is_held
    assert first.is_alive()
    looks.final = {first.submission_id, third.submission_id}
    assert first.has_come_back()
    assert third.has_come_back()


def test_who_finds_no_place_is_answered_at_once_and_the_later_the_more_there_are(
    watcher: long_poll.Watcher, looks: Looks
) -> None:
    waiters = seated(watcher, looks, 3)
    assert not watcher.hold(uuid4(), wait_s=WAIT_S, is_gone=stays)
    assert watcher.retry_after_s(rng=RNG) == 1
    for _ in range(40):
        assert not watcher.hold(uuid4(), wait_s=WAIT_S, is_gone=stays)
    assert 8 <= watcher.retry_after_s(rng=RNG) <= 13
    for _ in range(2_000):
        watcher.hold(uuid4(), wait_s=WAIT_S, is_gone=stays)
    assert watcher.retry_after_s(rng=RNG) == long_poll.LONGEST_RETRY_AFTER_S
    # A place that is free again is given away again.
    looks.final = {waiter.submission_id for waiter in waiters}
    assert all(waiter.has_come_back() for waiter in waiters)
    assert seated(watcher, looks, 1)[0].is_alive()


def test_a_watcher_does_not_ask_for_who_has_left(looks: Looks) -> None:
    slow = long_poll.Watcher(look=looks, n_places=lambda: 3, every_s=WAIT_S)
    # Seen to be gone at the first look, and away before the next one, which comes when all are let go.
    [waiter] = seated(slow, looks, 1, is_gone=lambda: True)
    assert waiter.has_come_back()
    slow.close()
    ended()
    assert len(looks.asked) == 1


def test_who_has_gone_takes_no_place(watcher: long_poll.Watcher, looks: Looks) -> None:
    is_gone = threading.Event()
    [waiter] = seated(watcher, looks, 1, is_gone=is_gone.is_set)
    is_gone.set()
    assert waiter.has_come_back()


def test_a_process_that_ends_lets_everybody_go_and_takes_nobody(
    watcher: long_poll.Watcher, looks: Looks
) -> None:
    waiters = seated(watcher, looks, 3)
    watcher.close()
    assert all(waiter.has_come_back() for waiter in waiters)
    assert not watcher.hold(uuid4(), wait_s=WAIT_S, is_gone=stays)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.parametrize("fault", [DatabaseError("away"), OSError("away"), ValueError("a bug")])
def test_nobody_hangs_on_a_watcher_that_fails(
    watcher: long_poll.Watcher, looks: Looks, fault: Exception
) -> None:
    waiters = seated(watcher, looks, 2)
    looks.fault = fault
    assert all(waiter.has_come_back() for waiter in waiters)
    looks.fault, looks.final = None, set()
    [again] = seated(watcher, looks, 1)
    looks.final = {again.submission_id}
    assert again.has_come_back()


def test_a_closed_connection_is_noticed() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        assert not _is_gone({"gunicorn.socket": ours})
        theirs.send(b"GET /next HTTP/1.1")
        assert not _is_gone({"gunicorn.socket": ours})  # the next request on the same connection
        ours.recv(100)
        theirs.close()
        assert _is_gone({"gunicorn.socket": ours})
    assert not _is_gone({})


# --- over the API ----------------------------------------------------------------------------------------


def address(submission: Submission, wait: object) -> str:
    return f"/api/v1/submissions/{submission.pk}?wait={wait}"


@pytest.fixture
def waiting_one(edition: Edition, owner: User) -> Submission:
    return builders.submit(owner, builders.predictions(edition))


@pytest.mark.parametrize("wait", ["-1", "61", "x", "1.5", "", "1e1", "٣", "9" * 5000, " 5"])
def test_bad_wait_is_a_400(waiting_one: Submission, owner: User, wait: str) -> None:
    response = client_of(owner).get(address(waiting_one, wait))
    assert (response.status_code, response.json()["code"]) == (400, "bad-wait")
    assert "expected whole seconds, from 0 to 60" in response.json()["detail"]


def test_who_asks_again_and_again_keeps_nobody_else_in_memory(
    monkeypatch: pytest.MonkeyPatch, looks: Looks
) -> None:
    monkeypatch.setattr(long_poll, "LONGEST_RETRY_AFTER_S", 0)
    full = long_poll.Watcher(look=looks, n_places=lambda: 0, every_s=0.01)
    stubborn, others = uuid4(), [uuid4() for _ in range(5)]
    for asker in (stubborn, *others, stubborn):
        assert not full.hold(asker, wait_s=1, is_gone=stays)
    assert set(full._turned_away) == {stubborn}


def test_who_finds_no_place_keeps_the_connection_to_the_database() -> None:
    prepared: list[int] = []

    def wait(n_places: int) -> bool:
        watcher = long_poll.Watcher(look=set, n_places=lambda: n_places, every_s=0.01)
        return watcher.hold(uuid4(), wait_s=1, is_gone=stays, prepare=lambda: prepared.append(n_places))

    assert (wait(0), wait(1)) == (False, True)
    assert prepared == [1]


def test_without_a_place_the_present_state_comes_with_retry_after(
    waiting_one: Submission, owner: User, settings: Settings
) -> None:
    settings.WAITERS = 0
    response = client_of(owner).get(address(waiting_one, 60))
    assert (response.status_code, response.json()["state"]) == (200, "QUEUED")
    assert int(response.headers["Retry-After"]) >= 1


def test_what_is_final_is_answered_at_once(waiting_one: Submission, owner: User, settings: Settings) -> None:
    settings.WAITERS = 0
    builders.score_all()
    response = client_of(owner).get(address(waiting_one, 60))
    assert (response.json()["state"], response.headers.get("Retry-After")) == ("SCORED", None)


def test_others_submissions_cannot_be_waited_for(waiting_one: Submission, stranger: User) -> None:
    assert client_of(stranger).get(address(waiting_one, 60)).status_code == 404


def test_all_are_looked_for_in_two_questions(
    edition: Edition, owner: User, django_assert_num_queries
) -> None:
    made = [builders.submit(owner, builders.predictions(edition, factor=1 + n / 10)) for n in range(1, 4)]
    with django_assert_num_queries(2):
        assert long_poll.final_among([row.pk for row in made]) == set()
    builders.score_all()
    gone = uuid4()
    assert long_poll.final_among([made[0].pk, gone]) == {made[0].pk, gone}


@pytest.fixture
def watcher_ends(transactional_db: None) -> Iterator[None]:
    """Before the test's database is gone."""
    yield
    ended()


@pytest.mark.usefixtures("watcher_ends")
@pytest.mark.skipif(
    connection.vendor != "postgresql",
    reason="SQLite in memory has one connection for all; `python -m tests.on_postgresql` runs this",
)
def test_waiters_hold_no_connection_and_hear_the_end_of_it(waiting_one: Submission, owner: User) -> None:
    client = client_of(owner)
    is_waiting = threading.Event()

    def wait() -> str:
        is_waiting.set()
        return client.get(address(waiting_one, 60)).json()["state"]

    def look() -> str:
        return str(APIClient().get("/api/v1/splits").status_code)

    def score() -> str:
        is_waiting.wait(PATIENCE_S)
        builders.score_all()
        return "scored"

    assert at_once(wait, wait, score, look) == ["SCORED", "SCORED", "scored", "200"]
