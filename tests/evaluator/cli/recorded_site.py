"""A real HTTP server on loopback that gives recorded answers, among them the faults of an unhealthy one."""

from __future__ import annotations

import json
import ssl
import threading
from collections import defaultdict
from dataclasses import dataclass, field
from email import message_from_bytes
from email.message import Message
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Self

CUT = "cut"  # close the connection without an answer
CUT_SHORT = "cut short"  # promise more bytes than are sent
IS_LEADERBOARD = "GET /api/v1/splits"


@dataclass(frozen=True)
class Reply:
    """One answer. `body` is sent as JSON unless it is bytes."""

    body: object = b""
    status: int = 200
    headers: dict[str, str] = field(default_factory=dict)
    fault: str = ""

    def encoded(self) -> bytes:
        return self.body if isinstance(self.body, bytes) else json.dumps(self.body).encode()


def problem(detail: str, *, code: str = "x", where: str = "") -> dict[str, Any]:
    """An error as the API words it: the sentence as detail and as the one problem."""
    return {
        "title": "Title",
        "detail": detail,
        "code": code,
        "problems": [{"code": code, "message": detail, "where": where}],
    }


@dataclass(frozen=True)
class Request:
    method: str
    path: str
    headers: Message
    body: bytes

    def parts(self) -> dict[str, tuple[str | None, bytes]]:
        """The multipart form: name to (file name, content)."""
        head = f"Content-Type: {self.headers['Content-Type']}\r\n\r\n".encode()
        message: Any = message_from_bytes(head + self.body)
        return {
            part.get_param("name", header="content-disposition"): (
                part.get_filename(),
                part.get_payload(decode=True),
            )
            for part in message.get_payload()
        }


class RecordedSite:
    """Give the answers put for `METHOD path` in turn, the last one for ever; keep the requests.

    Without a `port` it takes one that is free.
    """

    def __init__(self, *, port: int = 0) -> None:
        self.requests: list[Request] = []  # without the question whether this is a leaderboard at all
        self._replies: dict[str, list[Reply]] = defaultdict(list)
        self._server = ThreadingHTTPServer(("127.0.0.1", port), self._handler())
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.01,))

    def wrap(self, context: ssl.SSLContext) -> None:
        """Answer over TLS from now on."""
        self._server.socket = context.wrap_socket(self._server.socket, server_side=True)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self._server.server_port}"

    @property
    def posts(self) -> list[Request]:
        """The requests that sent something."""
        return [request for request in self.requests if request.method == "POST"]

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()

    def put(self, what: str, *replies: Reply) -> None:
        """Answer `what`, for instance "GET /api/v1/splits/test/board", with `replies` in turn."""
        self._replies[what].extend(replies)

    def next_reply(self, what: str) -> Reply:
        replies = self._replies[what.partition("?")[0]]
        if not replies and what == IS_LEADERBOARD:
            return Reply([{"split": "val"}])
        if not replies:
            return Reply({"title": "Not Found", "detail": f"Nothing recorded for {what}."}, status=404)
        return replies.pop(0) if len(replies) > 1 else replies[0]

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        site = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def answer(self) -> None:
                reply = site.next_reply(f"{self.command} {self.path}")
                n_bytes = int(self.headers.get("Content-Length", 0))
                body = self.rfile.read(n_bytes)
                if f"{self.command} {self.path}" != IS_LEADERBOARD:
                    site.requests.append(Request(self.command, self.path, self.headers, body))
                self.close_connection = bool(reply.fault)
                if reply.fault == CUT:
                    return
                content = reply.encoded()
                self.send_response(reply.status)
                self.send_header("Content-Length", str(len(content) + (reply.fault == CUT_SHORT)))
                for name, value in ({"Content-Type": "application/json"} | reply.headers).items():
                    self.send_header(name, value)
                self.end_headers()
                self.wfile.write(content)

            do_GET = do_POST = answer  # noqa: N815 -- the names that http.server calls

            def log_message(self, format: str, *args: object) -> None:  # noqa: A002 -- http.server's signature
                """Keep the test's output quiet."""

        return Handler
