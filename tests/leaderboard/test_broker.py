"""`leaderboard.broker`: a nudge never fails and never keeps anybody waiting for long."""

import socket
import uuid
from collections.abc import Iterator

import pytest
from kombu import Connection

from leaderboard import broker
from leaderboard.broker import Rest


@pytest.fixture
def listener(monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    """A server that lets clients connect and then says nothing; nudges go to it."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"redis://127.0.0.1:{server.getsockname()[1]}/0"
        pool = Connection(url, transport_options=broker.IMPATIENT).Pool(2)
        monkeypatch.setattr(broker, "_connections", lambda: pool)
        monkeypatch.setattr(broker, "_rest", Rest(rest_s=60))
        server.setblocking(False)
        yield server


def n_connected(listener: socket.socket) -> int:
    """Connections since the last question."""
    n = 0
    while True:
        try:
            listener.accept()[0].close()
        except BlockingIOError:
            return n
        n += 1


def test_a_message_reaches_the_broker() -> None:
    assert broker.nudge(uuid.uuid4())


def test_a_broker_that_is_down_is_no_fault(listener: socket.socket) -> None:
    listener.close()
    assert not broker.nudge(uuid.uuid4())


def test_a_broker_that_hangs_is_given_up_and_then_left_alone_for_a_while(listener: socket.socket) -> None:
    assert not broker.nudge(uuid.uuid4())
    assert n_connected(listener) >= 1
    assert not broker.nudge(uuid.uuid4())
    assert n_connected(listener) == 0


def test_a_rest_ends(listener: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(broker, "_rest", Rest(rest_s=0))
    assert not broker.nudge(uuid.uuid4())
    n_connected(listener)
    assert not broker.nudge(uuid.uuid4())
    assert n_connected(listener) >= 1
