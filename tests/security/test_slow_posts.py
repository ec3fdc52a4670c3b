"""Slow requests wait in the proxy, not in a thread of the web process: with Caddy, where there is one."""

import re
import shutil
import socket
import subprocess
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import httpx
import pytest

from tests.journeys.production import PATIENCE_S, await_that, end
from tests.services import REPOSITORY, free_port

pytestmark = pytest.mark.slow
N_SLOW = 60
# As large as a request may be, and its end is never sent.
UNFINISHED = (
    b"Content-Length: 200000\r\n\r\n" + b"x" * 70_000,
    b"Transfer-Encoding: chunked\r\n\r\n" + b"%x\r\n" % 1_000_000 + b"x" * 1_000_000 + b"\r\n",
)


@dataclass
class Behind:
    """What stands behind the proxy: the address of each request that it was passed, and its header names."""

    url: str
    passed: list[str] = field(default_factory=list)
    names: set[str] = field(default_factory=set)


def caddy() -> str:
    """The program. Skips the test where it is absent or older than deploy/Caddyfile.host asks for."""
    path = shutil.which("caddy")
    if path is None:
        pytest.skip("no caddy on the PATH")
    version = subprocess.run([path, "version"], capture_output=True, text=True, check=True).stdout
    numbers = re.match(r"v?(\d+)\.(\d+)\.(\d+)", version)
    if numbers is None or tuple(map(int, numbers.groups())) < (2, 6, 4):
        pytest.skip(f"caddy is {version.strip()}; 2.6.4 or newer has request_buffers")
    return path


@pytest.fixture
def behind(tmp_path: Path) -> Iterator[Behind]:
    program, port = caddy(), free_port()
    found = Behind(url=f"http://127.0.0.1:{port}")

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            found.passed.append(self.path)
            found.names.update(self.headers)
            self.rfile.read(int(self.headers.get("Content-Length", 0)))
            self.send_response(200)
            self.end_headers()

        def do_POST(self) -> None:
            self.do_GET()

        def log_message(self, *_: object) -> None:
            """Say nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, daemon=True).start()
        text = (REPOSITORY / "deploy/Caddyfile.host").read_text()
        text = text.replace("board.example.org {", f"http://127.0.0.1:{port} {{")
        text = text.replace("127.0.0.1:8000", f"127.0.0.1:{server.server_address[1]}")
        text = text.replace("\n{\n", "\n{\n\tadmin off\n", 1)
        (tmp_path / "Caddyfile").write_text(text)
        command = [program, "run", "--adapter", "caddyfile", "--config", str(tmp_path / "Caddyfile")]
        with (tmp_path / "log").open("wb") as log:
            process = subprocess.Popen(
                command, stdout=log, stderr=log, env={"HOME": str(tmp_path)}, start_new_session=True
            )
        try:
            await_that(lambda: is_open(port), what="Caddy answers")
            yield found
        finally:
            end(process)
            server.shutdown()


def is_open(port: int) -> bool:
    try:
        socket.create_connection(("127.0.0.1", port)).close()
    except OSError:
        return False
    return True


@pytest.mark.parametrize("body", UNFINISHED, ids=["said-length", "chunks-up-to-the-limit"])
def test_a_request_that_is_not_whole_is_passed_to_nobody(behind: Behind, body: bytes) -> None:
    port = int(behind.url.rpartition(":")[2])
    with ExitStack() as connections:
        for _ in range(N_SLOW):
            sender = connections.enter_context(socket.create_connection(("127.0.0.1", port)))
            sender.sendall(b"POST /accounts/login/ HTTP/1.1\r\nHost: 127.0.0.1:%d\r\n" % port + body)
            # Whoever comes later is answered first.
            assert httpx.get(f"{behind.url}/board/", timeout=PATIENCE_S, trust_env=False).status_code == 200
        assert behind.passed == ["/board/"] * N_SLOW


def test_what_is_whole_is_passed_on_and_what_is_too_large_is_refused(behind: Behind) -> None:
    with httpx.Client(base_url=behind.url, timeout=PATIENCE_S, trust_env=False) as client:
        assert client.post("/accounts/login/", content=b"x" * 1_000_000).status_code == 200
        assert client.post("/accounts/login/", content=b"x" * 1_000_001).status_code == 413
        assert client.post("/submit/", content=b"x" * 21_000_000).status_code == 200
        assert client.post("/submit/", content=b"x" * 21_000_001).status_code == 413


def test_header_names_with_an_underscore_end_at_the_proxy(behind: Behind) -> None:
    names = ("SCRIPT_NAME", "script_name", "PATH_INFO", "X_Forwarded_For", "Kept")
    headers = dict.fromkeys(names, "/x")
    assert httpx.get(behind.url, headers=headers, timeout=PATIENCE_S, trust_env=False).status_code == 200
    assert "Kept" in behind.names
    assert [name for name in behind.names if "_" in name] == []
