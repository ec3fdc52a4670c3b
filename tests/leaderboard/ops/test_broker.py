"""`leaderboard.ops.broker`: a nudge never fails and never keeps anybody waiting for long."""

import socket
from collections.abc import Iterator

import pytest
from kombu import Connection
from pytest_django import DjangoCaptureOnCommitCallbacks

from leaderboard import tasks
from leaderboard.models import Edition, User
from leaderboard.ops import broker
from leaderboard.ops.broker import CircuitBreaker
from tests import builders


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


@pytest.mark.slow
def test_a_broker_that_hangs_is_given_up_and_then_left_alone_for_a_while(listener: socket.socket) -> None:
    assert not broker.nudge()
    assert n_connected(listener) >= 1
    assert not broker.nudge()
    assert n_connected(listener) == 0


# --- one message for each event ---------------------------------------------------------------------------


@pytest.fixture
def sent_messages(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The messages that were sent."""
    sent_messages: list[str] = []

    def send(task: str) -> bool:
        sent_messages.append(task)
        return True

    monkeypatch.setattr(broker, "_sent", send)
    return sent_messages


@pytest.mark.parametrize("visibility", ["PUBLIC", "PRIVATE"])
def test_a_file_sent_and_a_file_decided_are_one_message_each(
    edition: Edition,
    owner: User,
    sent_messages: list[str],
    visibility: str,
    django_capture_on_commit_callbacks: DjangoCaptureOnCommitCallbacks,
) -> None:
    with django_capture_on_commit_callbacks(execute=True):
        builders.submit(owner, builders.predictions(edition), visibility=visibility)
    assert sent_messages.count("nudge") == 1
    sent_messages.clear()
    with django_capture_on_commit_callbacks(execute=True):
        builders.score_all()
    assert sent_messages == ["work_off"]
