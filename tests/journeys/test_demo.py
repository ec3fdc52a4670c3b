"""The demo as a person meets it: one process to start, a board in the browser, Ctrl-C to end it."""

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

import httpx2
import pytest

from leaderboard.demo.seed import ENTRIES
from leaderboard.management.commands.demo import names_of
from tests.journeys.people import Visitor
from tests.journeys.production import REPOSITORY, TIMEOUT_S, Site, await_that, free_port, get
from tests.leaderboard.sandbox.child_processes import kernel_says
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
            supervisor.wait(timeout=TIMEOUT_S)


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
        output = banner(supervisor)
        assert url in output
        n_scored = sum(entry.run is not None for entry in ENTRIES)
        await_that(lambda: len(entries(url)) == n_scored, what="every demo submission is scored")

        login = re.search(r"Sign in as (\S+) with the password (\S+)", output)
        assert login, output
        assert "Maintain as maintainer@example.org with the same password" in output
        assert f"mails in {tmp_path / 'mail'}" in output
        site = Site(url=url, directory=tmp_path, environment={})
        visitor = Visitor(site)
        answer = visitor.post_form("/accounts/login/", {"login": login[1], "password": login[2]})
        assert answer.url.path == "/submissions/"
        maintainer = Visitor(site)
        maintainer.post_form("/accounts/login/", {"login": "maintainer@example.org", "password": login[2]})
        assert "Queue" in maintainer.text_of("/maintain/")
        maintainer.post_form("/accounts/password/reset/", {"email": login[1]})
        (mail,) = site.mails
        assert "/accounts/password/reset/key/" in mail
        maintainer.close()
        assert "simulated" in visitor.text_of("/board/demo/").lower()
        assert f"pip install {url}/dist/tsttc-" in visitor.text_of("/dist/")
        assert "anno_id" in visitor.text_of("/docs/search/?q=anno_id")

        # Half-open connections keep nobody out, and a page elsewhere leads no name of its own here.
        with ExitStack() as connections:
            for _ in range(150):
                silent = connections.enter_context(socket.create_connection(("127.0.0.1", port)))
                silent.sendall(b"GET / HTTP/1.1\r\n")
            for name in ("localhost", "127.0.0.1", "localhost:8000", "[::1]:8000"):
                assert get(url, Host=name).status_code == 200
            assert get(url, Host="rebound.example.org").status_code == 400

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
        assert supervisor.wait(timeout=TIMEOUT_S) == 0
        assert not is_alive(first)
        assert not is_alive(second)
    with pytest.raises(httpx2.ConnectError):
        httpx2.get(url, trust_env=False)


@pytest.mark.parametrize(("host", "others"), [("192.0.2.7", ["192.0.2.7"]), ("fe80::1", ["[fe80::1]"])])
def test_the_names_of_the_demo_are_those_of_this_machine_and_the_chosen_one(
    host: str, others: list[str]
) -> None:
    assert names_of(host) == ["localhost", "127.0.0.1", "[::1]", *others]
    assert names_of("0.0.0.0") == ["*"]


def test_a_port_in_use_is_reported_in_a_sentence_and_nothing_is_made(tmp_path: Path) -> None:
    port = free_port()
    with socket.create_server(("127.0.0.1", port)), demo(tmp_path, port=port) as supervisor:
        assert supervisor.stdout is not None
        output = supervisor.stdout.read()
        assert supervisor.wait(timeout=TIMEOUT_S) == 1
    assert f"Port {port} on 127.0.0.1 is in use" in output
    assert "Traceback" not in output
    assert not (tmp_path / "leaderboard.sqlite3").exists()
