"""`leaderboard.broker`: a nudge never fails and never keeps anybody waiting for long."""

import json
import socket
import subprocess
import sys
import threading
import uuid
from collections.abc import Iterator
from pathlib import Path

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


# --- the one made of files ------------------------------------------------------------------------------


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "messages"


@pytest.fixture
def in_files(folder: Path) -> Iterator[Connection]:
    """A broker made of files, as `make demo` has it."""
    folder.mkdir()
    options = {"data_folder_in": str(folder), "data_folder_out": str(folder), "control_folder": str(folder)}
    with Connection("filesystem://", transport_options=options) as connection:
        yield connection


def test_a_message_in_files_is_whole_as_soon_as_it_is_seen(in_files: Connection, folder: Path) -> None:
    """A worker that finds half of one ends."""
    found: list[bytes] = []
    is_over = threading.Event()

    def look() -> None:
        while not is_over.is_set():
            found.extend(path.read_bytes() for path in folder.glob("*.msg"))

    looking = threading.Thread(target=look)
    looking.start()
    with in_files.SimpleQueue("news") as queue:
        for number in range(200):
            queue.put(number)
    is_over.set()
    looking.join()
    found.extend(path.read_bytes() for path in folder.glob("*.msg"))
    assert len({json.loads(message)["body"] for message in found}) == 200


def test_processes_that_bind_a_queue_in_files_at_once_find_no_half_written_table(folder: Path) -> None:
    folder.mkdir()
    program = (
        "import sys; from leaderboard.celery import app; from kombu import Connection\n"
        "folders = dict.fromkeys(('data_folder_in', 'data_folder_out', 'control_folder'), sys.argv[1])\n"
        "connection = Connection('filesystem://', transport_options=folders)\n"
        "for number in range(20): connection.SimpleQueue(f'news-{number}').put('x')\n"
    )
    command = [sys.executable, "-c", program, str(folder)]
    running = [subprocess.Popen(command) for _ in range(2)]
    assert [process.wait() for process in running] == [0, 0]
    for number in range(20):
        [[_, _, queue]] = json.loads((folder / f"news-{number}.exchange").read_text())
        assert queue == f"news-{number}"
