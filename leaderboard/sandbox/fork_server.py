"""The worker's side of the process that forks a reader for each prediction file.

Each thread that scores has one such process, started at its first file, replaced when it has ended. It ends
with the thread, or with the worker, however that ends.
"""

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
    """The process that forks readers has ended, and with it the reader; `began` if that had seen the file."""

    def __init__(self, *, began: bool) -> None:
        super().__init__()
        self.began = began


class NotStarted(Exception):
    """The process that forks readers is well and could not make one; the message says why."""


class Interrupted(Exception):
    """The heartbeat said no; the reader has been ended."""


class TooMuch(Exception):
    """The reader wrote more than any answer has; it has been ended."""


@dataclass(frozen=True)
class Answer:
    """What a reader wrote until it ended; `returncode` is negative for a signal."""

    returncode: int
    output: bytes
    complaint: bytes


def environment(*, python_path: Path) -> dict[str, str]:
    """What a process that reads files is given: no credentials, and one thread."""
    return {
        "PATH": os.defpath,
        "PYTHONPATH": str(python_path),
        "PYTHONDONTWRITEBYTECODE": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }


class ForkServer:
    """A process that forks readers, from its start to its end."""

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
        """Whether it runs, and this process started it: a copy made by `fork` must not share it."""
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
        """Have one file read by a process of its own, with a heartbeat every `heartbeat_s` seconds.

        Raises `NotStarted`, and with this server closed `ServerEnded`, `Interrupted`, or `TooMuch`.
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
        """Send the request, and keep this process's ends of the pipes."""
        stack.enter_context(reading)
        theirs = [source.fileno()]
        with ExitStack() as sent:
            for into in (reading.output, reading.complaint):
                ours, end = os.pipe()
                _widen(ours)
                reading.follow(ours, into)
                sent.callback(os.close, end)
                theirs.append(end)
            reading.listen(self._socket)
            try:
                socket.send_fds(self._socket, [json.dumps(request).encode()], theirs)
            except (BrokenPipeError, ConnectionResetError) as fault:
                raise ServerEnded(began=False) from fault


class _Reading:
    """One file on its way: what has come from the reader, and from the server about it.

    As a context it ends the reader that has not ended by itself.
    """

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
        """Receive what comes through the pipe, and close it at its end."""
        self._selector.register(pipe, selectors.EVENT_READ, into)
        self._n_open_pipes += 1

    def listen(self, server: socket.socket) -> None:
        """Receive what the server says of the reader."""
        self._selector.register(server, selectors.EVENT_READ, server)

    @property
    def is_complete(self) -> bool:
        """Whether the reader has ended, and all that it wrote is here."""
        return self._returncode is not None and not self._n_open_pipes

    def answer(self) -> Answer:
        """Of a reader that has ended."""
        if self._returncode is None:
            raise ValueError("the reader has not ended")
        return Answer(self._returncode, bytes(self.output), bytes(self.complaint))

    def receive(self, *, timeout_s: float) -> None:
        """What there is within that time. Raises `NotStarted`, `ServerEnded` or `TooMuch`."""
        for key, _ in self._selector.select(timeout_s):
            if isinstance(key.data, bytearray):
                self._read(key.fd, key.data)
            elif self._returncode is None:
                self._hear(key.data)

    def _read(self, pipe: int, into: bytearray) -> None:
        chunk = os.read(pipe, _CHUNK_BYTES)
        into += chunk
        if len(into) > self._max_bytes:
            raise TooMuch
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


def _widen(pipe: int) -> None:
    """Let an answer pass at once where it can; else the reader waits for us after each 64 KB."""
    with suppress(OSError):
        fcntl.fcntl(pipe, _SET_PIPE_SIZE, _CHUNK_BYTES)


def _end(server: socket.socket, pid: int, owner: int) -> None:
    """End the process; its reader ends with it. In a copy of the owner that `fork` made, only let go."""
    server.close()
    if os.getpid() == owner:
        with suppress(ProcessLookupError, ChildProcessError):
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)


class _Servers(threading.local):
    """The server of each thread."""

    server: ForkServer | None = None


_SERVERS = _Servers()


def server_of_this_thread(*, python_path: Path) -> ForkServer:
    """The one that this thread used last, or a new one. Raises `OSError` if none can be started."""
    server = _SERVERS.server
    if server is None or not server.is_ours:
        server = _SERVERS.server = ForkServer(python_path=python_path)
    return server
