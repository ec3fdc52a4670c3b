"""`leaderboard.ops.broker`: a nudge never fails and never keeps anybody waiting for long."""

import socket
import threading
from collections.abc import Iterator

import pytest
from django.db import transaction
from kombu import Connection
from pytest_django import DjangoCaptureOnCommitCallbacks

from leaderboard import tasks, versions
from leaderboard.models import Edition, User
from leaderboard.ops import broker
from leaderboard.ops.broker import CircuitBreaker, News
from tests import builders

pytestmark = pytest.mark.slow


@pytest.fixture
def listener(monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    """A server that lets clients connect and then says nothing; nudges go to it."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"redis://127.0.0.1:{server.getsockname()[1]}/0"
        pool = Connection(url, transport_options=broker.FAIL_FAST).Pool(2)
        monkeypatch.setattr(broker, "_connections", lambda: pool)
        monkeypatch.setattr(broker, "_rest", CircuitBreaker(rest_s=60))
        server.setblocking(False)
        yield server
        pool.force_close_all()


def n_connected(listener: socket.socket) -> int:
    """Connections since the last question."""
    n = 0
    while True:
        try:
            listener.accept()[0].close()
        except BlockingIOError:
            return n
        n += 1


def test_a_message_reaches_the_broker_and_bears_no_argument(monkeypatch: pytest.MonkeyPatch) -> None:
    with Connection("memory://") as connection:
        monkeypatch.setattr(broker, "_connections", lambda: connection.Pool(1))
        assert broker.nudge()
        message = connection.SimpleQueue("celery").get(timeout=60)
    assert message.headers["task"] == tasks.nudge.name
    assert message.payload[:2] == [[], {}]


def test_without_a_broker_nothing_is_sent() -> None:
    assert not broker.nudge()
    assert not broker.work_off()


def test_a_broker_that_is_down_is_no_fault(listener: socket.socket) -> None:
    listener.close()
    assert not broker.nudge()


def test_a_broker_that_hangs_is_given_up_and_then_left_alone_for_a_while(listener: socket.socket) -> None:
    assert not broker.nudge()
    assert n_connected(listener) >= 1
    assert not broker.nudge()
    assert n_connected(listener) == 0


def test_a_rest_ends(listener: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(broker, "_rest", CircuitBreaker(rest_s=0))
    assert not broker.nudge()
    n_connected(listener)
    assert not broker.nudge()
    assert n_connected(listener) >= 1


# --- one message for each event ---------------------------------------------------------------------------


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The messages that were sent."""
    told: list[str] = []

    def send(task: str) -> bool:
        told.append(task)
        return True

    monkeypatch.setattr(broker, "_sent", send)
    monkeypatch.setattr(broker, "_connections", object)
    monkeypatch.setattr(broker, "_news", News(lambda: send("work_off"), every_s=0))
    return told


@pytest.mark.parametrize("visibility", ["PUBLIC", "PRIVATE"])
def test_a_file_sent_and_a_file_decided_are_one_message_each(
    edition: Edition,
    owner: User,
    told: list[str],
    visibility: str,
    django_capture_on_commit_callbacks: DjangoCaptureOnCommitCallbacks,
) -> None:
    with django_capture_on_commit_callbacks(execute=True):
        builders.submit(owner, builders.predictions(edition), visibility=visibility)
    assert told.count("nudge") == 1
    told.clear()
    with django_capture_on_commit_callbacks(execute=True):
        builders.score_all()
    assert told == ["work_off"]


def test_a_change_on_every_board_is_one_message(
    benchmark: None, told: list[str], django_capture_on_commit_callbacks: DjangoCaptureOnCommitCallbacks
) -> None:
    with django_capture_on_commit_callbacks(execute=True), transaction.atomic():
        versions.changed_everywhere()
    assert told == ["work_off"]


def test_of_many_messages_at_once_the_first_is_sent_and_one_for_all_others() -> None:
    told = threading.Semaphore(0)
    news = News(told.release, every_s=0.5)
    assert [news.is_first() for _ in range(50)] == [True, *[False] * 49]
    assert told.acquire(timeout=60)
    assert not told.acquire(blocking=False)


def test_what_comes_after_the_message_for_all_others_is_told_again() -> None:
    told = threading.Semaphore(0)
    news = News(told.release, every_s=0.05)
    assert news.is_first()
    for _ in range(3):
        assert news.is_first() or told.acquire(timeout=60)
