"""A network that fails while a file is sent: passes everything on, and cuts the connection of an upload."""

import select
import socket
from enum import Enum

from tests.leaderboard.scoring.cutting_proxy import Proxy

PIECE = 1 << 14


class Cut(Enum):
    """When the connection of an upload is cut."""

    IN_THE_MIDDLE = "when the server has half of it"
    BEFORE_THE_ANSWER = "when the server has done it, and before anybody hears so"


class MovingNetwork(Proxy):
    """One address for a server that is first here and then there."""

    def __init__(self) -> None:
        super().__init__(host="127.0.0.1", port=0)
        self.url = f"http://127.0.0.1:{self.port}"

    def lead_to(self, url: str) -> None:
        """Where new connections go."""
        self._target = ("127.0.0.1", int(url.rpartition(":")[2]))

    def _pass_on(self, client: socket.socket) -> None:
        with client, socket.create_connection(self._target) as server:
            other = {client: server, server: client}
            while True:
                ready, _, _ = select.select([client, server], [], [])
                for end in ready:
                    said = end.recv(PIECE)
                    if not said:
                        return
                    other[end].sendall(said)


class CutNetwork(Proxy):
    """Passes on to a port of this machine; the next uploads are cut as `cuts` says, one after the other."""

    def __init__(self, port: int, *cuts: Cut) -> None:
        super().__init__(host="127.0.0.1", port=port)
        self.url = f"http://127.0.0.1:{self.port}"
        self._cuts = list(cuts)
        self.n_uploads = 0

    @property
    def n_cuts_left(self) -> int:
        """Cuts that no upload has met yet."""
        return len(self._cuts)

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
