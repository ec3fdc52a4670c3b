"""A proxy between a client and PostgreSQL that cuts the connection at the n-th round trip.

A round trip begins with whatever the client sends after the server has spoken. It is cut before the server
has heard it, or after the server has done it and before the client hears the answer: that is how the answer
to a COMMIT gets lost.
"""

import select
import socket
import threading
from contextlib import suppress
from enum import Enum
from typing import Self

PIECE = 1 << 16


class Cut(Enum):
    """The moment at which the connection is cut."""

    BEFORE_THE_SERVER_HEARS = "before"
    BEFORE_THE_CLIENT_HEARS = "after"


class Proxy:
    """Listens, and serves each connection in a thread of its own; `_pass_on` says how."""

    def __init__(self, *, host: str, port: int) -> None:
        self._target = (host, port)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._accept, name="proxy", daemon=True)

    def __enter__(self) -> Self:
        """Listen."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Accept no more; what is connected ends with its client."""
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._thread.join(10)

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(client,), name="proxied", daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        """Whichever side breaks off ends it for both, and is no fault of the proxy."""
        with suppress(ConnectionError):
            self._pass_on(client)

    def _pass_on(self, client: socket.socket) -> None:
        raise NotImplementedError


class CuttingProxy(Proxy):
    """Passes everything on, and counts round trips from `arm` on, over all its connections."""

    def __init__(self, *, host: str, port: int) -> None:
        super().__init__(host=host, port=port)
        self._n_left = 0
        self._cut = Cut.BEFORE_THE_SERVER_HEARS
        self.was_cut = False

    def arm(self, *, at: int, cut: Cut) -> None:
        """Cut the `at`-th round trip from now, the first being 1."""
        with self._lock:
            self._n_left, self._cut, self.was_cut = at, cut, False

    def disarm(self) -> None:
        """Cut nothing any more."""
        with self._lock:
            self._n_left = 0

    def _is_the_one(self) -> bool:
        """Count one round trip; whether it is the one to cut."""
        with self._lock:
            if self._n_left == 0:
                return False
            self._n_left -= 1
            self.was_cut = self._n_left == 0
            return self.was_cut

    def _pass_on(self, client: socket.socket) -> None:
        with client, socket.create_connection(self._target) as server:
            server_spoke = True
            while True:
                ready, _, _ = select.select([client, server], [], [])
                if client in ready:
                    message = client.recv(PIECE)
                    is_cut = bool(message) and server_spoke and self._is_the_one()
                    if not message or (is_cut and self._cut is Cut.BEFORE_THE_SERVER_HEARS):
                        return
                    server.sendall(message)
                    server_spoke = False
                    if is_cut:
                        # The answer has come: what was asked is done.
                        server.recv(PIECE)
                        return
                if server in ready:
                    answer = server.recv(PIECE)
                    if not answer:
                        return
                    client.sendall(answer)
                    server_spoke = True
