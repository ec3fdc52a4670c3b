"""The worker's side of the process that forks a reader for each prediction file, one for each thread."""

import fcntl
import json
import os
import selectors
import signal
import socket
import sys
import threading
import time
import weakref
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Self

from evaluator.predictions.reader_server import MAX_PACKET_BYTES

AVAILABLE = sys.platform == "linux"
"""Elsewhere `fork` after loading numpy is not safe, or a process cannot be tied to its parent's life."""

_CHUNK_BYTES = 1 << 20
_SET_PIPE_SIZE = 1031  # F_SETPIPE_SZ, whose name `fcntl` has on Linux only


class ServerEnded(Exception):
    """The fork server has ended, and its reader with it; `began` if the reader had seen the file."""

    def __init__(self, *, began: bool) -> None:
        super().__init__()
        self.began = began


class NotStarted(Exception):
    """The fork server could not start a reader."""


class Interrupted(Exception):
    """The heartbeat returned False; the reader has been ended."""


class AnswerTooLarge(Exception):
    """The reader wrote more than any answer has; it has been ended."""


@dataclass(frozen=True)
class Answer:
    """The output of a reader that ended; `returncode` is negative for a signal."""

    returncode: int
    output: bytes
    complaint: bytes


def environment(*, python_path: Path) -> dict[str, str]:
    """Return the environment of a process that reads files: no credentials, one thread."""
    return {
        "PATH": os.defpath,
        "PYTHONPATH": str(python_path),
        "PYTHONDONTWRITEBYTECODE": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }


class ForkServer:
    """A process that forks readers."""

    def __init__(self, *, python_path: Path) -> None:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            pid = os.posix_spawn(
                sys.executable,
                [sys.executable, "-m", "evaluator.predictions.reader_server"],
                environment(python_path=python_path),
                file_actions=[
                    (os.POSIX_SPAWN_DUP2, theirs.fileno(), 0),
                    (os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0),
                ],
            )
        self.pid = pid
        self.has_served = False
        self._socket = ours
        self._owner = os.getpid()
        self.close = weakref.finalize(self, _end, ours, pid, self._owner)
        """End the process and whatever it has forked. May be called twice."""

    @property
    def is_ours(self) -> bool:
        # A copy made by `fork` must not share it.
        return self.close.alive and self._owner == os.getpid()

    def read(
        self,
        source: IO[bytes],
        *,
        request: dict[str, object],
        max_bytes: int,
        heartbeat: Callable[[], bool],
        heartbeat_s: float,
    ) -> Answer:
        """Read one file in a process of its own, with a heartbeat every `heartbeat_s` seconds.

        Raises `NotStarted`; `ServerEnded`, `Interrupted` or `AnswerTooLarge`, which close this server.
        """
        reading = _Reading(max_bytes=max_bytes)
        try:
            with ExitStack() as stack:
                self._begin(source, request, reading, stack=stack)
                next_beat_s = time.monotonic() + heartbeat_s
                while not reading.is_complete:
                    reading.receive(timeout_s=max(0.0, next_beat_s - time.monotonic()))
                    if time.monotonic() >= next_beat_s:
                        if not heartbeat():
                            raise Interrupted
                        next_beat_s = time.monotonic() + heartbeat_s
                self.has_served = True
                return reading.answer()
        except NotStarted:
            raise
        except BaseException:
            self.close()
            raise

    def _begin(
        self, source: IO[bytes], request: dict[str, object], reading: "_Reading", *, stack: ExitStack
    ) -> None:
        stack.enter_context(reading)
        theirs = [source.fileno()]
        with ExitStack() as sent:
            for into in (reading.output, reading.complaint):
                ours, end = os.pipe()
                # Else the reader waits for us after each 64 KB.
                with suppress(OSError):
                    fcntl.fcntl(ours, _SET_PIPE_SIZE, _CHUNK_BYTES)
                reading.follow(ours, into)
                sent.callback(os.close, end)
                theirs.append(end)
            reading.listen(self._socket)
            try:
                socket.send_fds(self._socket, [json.dumps(request).encode()], theirs)
            except (BrokenPipeError, ConnectionResetError) as fault:
                raise ServerEnded(began=False) from fault


class _Reading:
    """The state of one file while it is read. As a context it ends the reader that has not ended."""

    def __init__(self, *, max_bytes: int) -> None:
        self.output = bytearray()
        self.complaint = bytearray()
        self._max_bytes = max_bytes
        self._returncode: int | None = None
        self._process: int | None = None
        self._selector = selectors.DefaultSelector()
        self._n_open_pipes = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for key in list(self._selector.get_map().values()):
            if isinstance(key.data, bytearray):
                os.close(key.fd)
        self._selector.close()
        if self._process is not None:
            if self._returncode is None:
                with suppress(ProcessLookupError):
                    signal.pidfd_send_signal(self._process, signal.SIGKILL)
            os.close(self._process)

    def follow(self, pipe: int, into: bytearray) -> None:
        """Receive from the pipe, and close it at its end."""
        self._selector.register(pipe, selectors.EVENT_READ, into)
        self._n_open_pipes += 1

    def listen(self, server: socket.socket) -> None:
        self._selector.register(server, selectors.EVENT_READ, server)

    @property
    def is_complete(self) -> bool:
        return self._returncode is not None and not self._n_open_pipes

    def answer(self) -> Answer:
        if self._returncode is None:
            raise ValueError("the reader has not ended")
        return Answer(self._returncode, bytes(self.output), bytes(self.complaint))

    def receive(self, *, timeout_s: float) -> None:
        """Receive what comes within that time. Raises `NotStarted`, `ServerEnded` or `AnswerTooLarge`."""
        for key, _ in self._selector.select(timeout_s):
            if isinstance(key.data, bytearray):
                self._read(key.fd, key.data)
            elif self._returncode is None:
                self._hear(key.data)

    def _read(self, pipe: int, into: bytearray) -> None:
        chunk = os.read(pipe, _CHUNK_BYTES)
        into += chunk
        if len(into) > self._max_bytes:
            raise AnswerTooLarge
        if not chunk:
            self._selector.unregister(pipe)
            os.close(pipe)
            self._n_open_pipes -= 1

    def _hear(self, server: socket.socket) -> None:
        try:
            packet, descriptors, _, _ = socket.recv_fds(server, MAX_PACKET_BYTES, 1)
        except ConnectionResetError:
            packet, descriptors = b"", []
        if not packet:
            raise ServerEnded(began=bool(self.output))
        for descriptor in descriptors:
            self._process = descriptor
        reply = json.loads(packet)
        if "failed" in reply:
            raise NotStarted(reply["failed"])
        self._returncode = reply.get("returncode")


def _end(server: socket.socket, pid: int, owner: int) -> None:
    """End the server and its reader. In a forked copy of the owner, only let go."""
    server.close()
    if os.getpid() == owner:
        with suppress(ProcessLookupError, ChildProcessError):
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)


class _Servers(threading.local):
    server: ForkServer | None = None


_SERVERS = _Servers()


def server_of_this_thread(*, python_path: Path) -> ForkServer:
    """Return this thread's server, new if need be. Raises `OSError` if none can be started."""
    server = _SERVERS.server
    if server is None or not server.is_ours:
        server = _SERVERS.server = ForkServer(python_path=python_path)
    return server
