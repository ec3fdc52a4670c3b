"""The demo as somebody meets it: one process to start, a board in the browser, Ctrl-C to end it."""

import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from leaderboard.demo.seed import ENTRIES
from leaderboard.management.commands.demo import SILENT_S, names_of, processes
from tests.journeys.people import Visitor
from tests.journeys.production import PATIENCE_S, REPOSITORY, Site, await_that, end, free_port, get
from tests.leaderboard.scoring.child_processes import kernel_says
from tests.prepared import put_sqlite, static_files
from tests.services import environment_of_its_own
from tests.signals import default_signals

pytestmark = pytest.mark.slow


def environment(directory: Path) -> dict[str, str]:
    return environment_of_its_own() | {
        "TSTTC_DATA_DIR": str(directory),
        "TSTTC_STATIC_ROOT": str(directory / "static"),
    }


@contextmanager
def demo(directory: Path, *, port: int) -> Iterator[subprocess.Popen[str]]:
    """The demo's supervisor, ended at the end however the test went."""
    with default_signals():
        supervisor = subprocess.Popen(
            [sys.executable, "manage.py", "demo", "--port", str(port)],
            cwd=REPOSITORY,
            env=environment(directory),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
    with supervisor:
        try:
            yield supervisor
        finally:
            if supervisor.poll() is None:
                supervisor.terminate()
            supervisor.wait(timeout=PATIENCE_S)


def banner(supervisor: subprocess.Popen[str]) -> str:
    """What it prints until it is ready."""
    lines: list[str] = []
    assert supervisor.stdout is not None
    while not lines or "Ctrl-C" not in lines[-1]:
        line = supervisor.stdout.readline()
        assert line, "".join(lines)
        lines.append(line)
    return "".join(lines)


def entries(url: str) -> list[dict[str, Any]]:
    return list(get(f"{url}/api/v1/splits/demo/board").json()["entries"])


def workers(supervisor: subprocess.Popen[str]) -> list[int]:
    """The process ids of the worker that the supervisor holds."""
    children = Path(f"/proc/{supervisor.pid}/task/{supervisor.pid}/children").read_text().split()
    return [pid for pid in map(int, children) if "celery" in kernel_says(pid, "cmdline")]


def is_alive(pid: int) -> bool:
    status = kernel_says(pid, "status")
    return bool(status) and "\nState:\tZ" not in status


@pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc")
def test_the_demo_shows_scored_submissions_survives_a_dead_worker_and_ends_cleanly(tmp_path: Path) -> None:
    port = free_port()
    url = f"http://127.0.0.1:{port}"
    with demo(tmp_path, port=port) as supervisor:
        said = banner(supervisor)
        assert url in said
        n_scored = sum(entry.run is not None for entry in ENTRIES)
        await_that(lambda: len(entries(url)) == n_scored, what="every demo submission is scored")

        login = re.search(r"Sign in as (\S+) with the password (\S+)", said)
        assert login, said
        site = Site(url=url, directory=tmp_path, environment={})
        visitor = Visitor(site)
        answer = visitor.post_form("/accounts/login/", {"login": login[1], "password": login[2]})
        assert answer.url.path == "/submit/"
        assert "simulated" in visitor.text_of("/board/demo/").lower()
        assert f"pip install {url}/dist/tsttc-" in visitor.text_of("/dist/")
        assert "anno_id" in visitor.text_of("/docs/search/?q=anno_id")

        (first,) = workers(supervisor)
        os.kill(first, signal.SIGKILL)
        await_that(lambda: workers(supervisor) not in ([], [first]), what="another worker is started")
        again = visitor.submit(split="demo", method="After the crash", data=b'{"0": 1.0}')
        visitor_api = f"/api/v1/submissions/{again}"
        await_that(
            lambda: visitor.get(visitor_api).json()["state"] == "REJECTED", what="the new worker decides"
        )
        visitor.close()

        (second,) = workers(supervisor)
        supervisor.send_signal(signal.SIGINT)
        assert supervisor.wait(timeout=PATIENCE_S) == 0
        assert not is_alive(first)
        assert not is_alive(second)
    with pytest.raises(httpx.ConnectError):
        httpx.get(url, trust_env=False)


@contextmanager
def web_of_the_demo(directory: Path, *, host: str) -> Iterator[str]:
    """The demo's web process alone, on an empty database; where it listens on loopback."""
    port = free_port()
    put_sqlite(directory / "leaderboard.sqlite3")
    web, _ = processes(host, port, address=f"http://{host}:{port}")
    # None is closed for its silence while a test lasts.
    timeout = f"--channel-timeout={SILENT_S}"
    assert timeout in web.command
    command = [part.replace(timeout, "--channel-timeout=3600") for part in web.command]
    own = {**web.environment, "TSTTC_DATA_DIR": str(directory), "TSTTC_STATIC_ROOT": str(static_files())}
    with (directory / "web.log").open("wb") as log, default_signals():
        process = subprocess.Popen(
            command, cwd=REPOSITORY, env=own, stdout=log, stderr=log, start_new_session=True
        )
    url = f"http://127.0.0.1:{port}"

    def answers() -> bool:
        assert process.poll() is None, (directory / "web.log").read_text()
        try:
            return get(f"{url}/healthz").status_code == 200
        except httpx.TransportError:
            return False

    try:
        await_that(answers, what="the demo's web process answers")
        yield url
    finally:
        end(process)


def test_half_open_connections_to_the_demo_keep_nobody_out(tmp_path: Path) -> None:
    with web_of_the_demo(tmp_path, host="127.0.0.1") as url, ExitStack() as connections:
        for _ in range(150):
            address = ("127.0.0.1", int(url.rpartition(":")[2]))
            connections.enter_context(socket.create_connection(address)).sendall(b"GET / HTTP/1.1\r\n")
        assert get(url).status_code == 200


@pytest.mark.parametrize(("host", "status"), [("127.0.0.1", 400), ("0.0.0.0", 200)])
def test_the_demo_answers_to_its_own_names_alone_unless_it_is_open_to_a_network(
    host: str, status: int, tmp_path: Path
) -> None:
    with web_of_the_demo(tmp_path, host=host) as url:
        for name in ("localhost", "127.0.0.1", "localhost:8000", "[::1]:8000"):
            assert get(url, Host=name).status_code == 200
        assert get(url, Host="rebound.example.org").status_code == status


def test_the_names_of_the_demo_are_those_of_this_machine_and_the_one_that_somebody_chose() -> None:
    assert names_of("192.0.2.7") == ["localhost", "127.0.0.1", "[::1]", "192.0.2.7"]
    assert names_of("fe80::1")[-1] == "[fe80::1]"


def test_a_port_in_use_is_said_in_a_sentence_and_nothing_is_made(tmp_path: Path) -> None:
    port = free_port()
    with socket.create_server(("127.0.0.1", port)), demo(tmp_path, port=port) as supervisor:
        assert supervisor.stdout is not None
        said = supervisor.stdout.read()
        assert supervisor.wait(timeout=PATIENCE_S) == 1
    assert f"Port {port} on 127.0.0.1 is in use" in said
    assert "Traceback" not in said
    assert not (tmp_path / "leaderboard.sqlite3").exists()
