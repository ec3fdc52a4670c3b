"""A network that fails while a file is sent: passes everything on, and cuts the connection of an upload."""

import select
import socket
import threading
from contextlib import suppress
from enum import Enum
from typing import Self

PIECE = 1 << 14


class Cut(Enum):
    """When the connection of an upload is cut."""

    IN_THE_MIDDLE = "when the server has half of it"
    BEFORE_THE_ANSWER = "when the server has done it, and before anybody hears so"


class CutNetwork:
    """Passes on to a port of this machine; the next uploads are cut as `cuts` says, one after the other."""

    def __init__(self, port: int, *cuts: Cut) -> None:
        self._target = ("127.0.0.1", port)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listener.getsockname()[1]}"
        self._lock = threading.Lock()
        self._cuts = list(cuts)
        self.n_uploads = 0
        self._thread = threading.Thread(target=self._accept, name="network", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._thread.join(10)

    @property
    def n_cuts_left(self) -> int:
        """Cuts that no upload has met yet."""
        return len(self._cuts)

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(client,), name="passed on", daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        """Whichever side breaks off ends it for both, and is no fault of the network."""
        with suppress(ConnectionError):
            self._pass_on(client)

    def _cut_of(self, said: bytes) -> Cut | None:
        """What is to happen to the upload that begins with this, if one does."""
        if not said.startswith(b"POST "):
            return None
        with self._lock:
            self.n_uploads += 1
            return self._cuts.pop(0) if self._cuts else None

    def _pass_on(self, client: socket.socket) -> None:
        cut: Cut | None = None
        n_passed = 0
        with client, socket.create_connection(self._target) as server:
            while True:
                ready, _, _ = select.select([client, server], [], [])
                if server in ready:
                    answer = server.recv(PIECE)
                    if not answer or cut is Cut.BEFORE_THE_ANSWER:
                        return
                    client.sendall(answer)
                if client in ready:
                    said = client.recv(PIECE)
                    if not said:
                        return
                    cut = cut or self._cut_of(said)
                    n_passed += len(said) if cut else 0
                    # The first piece is the head of the request; with the next one the file has begun.
                    if cut is Cut.IN_THE_MIDDLE and n_passed > len(said):
                        server.sendall(said[: len(said) // 2])
                        return
                    server.sendall(said)
