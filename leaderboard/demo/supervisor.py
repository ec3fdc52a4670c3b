"""Start the demo's processes, restart those that die, and end them together."""

import asyncio
import contextlib
import ctypes
import os
import signal
import socket
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

TIMEOUT_S = 30.0
"""How long a process may take to end by itself, and to open its port."""
MAX_QUICK_DEATHS = 5
QUICK_S = 10.0
_PR_SET_PDEATHSIG = 1


class StartFailed(RuntimeError):
    """A process does not stay up; the text has its name and its last lines."""


@dataclass
class Process:
    """A process to keep running; `log_path` takes its output."""

    name: str
    command: Sequence[str]
    log_path: Path
    environment: Mapping[str, str]
    n_quick_deaths: int = field(default=0, init=False)

    async def run(self, stop: asyncio.Event) -> None:
        """Keep it running until `stop`, then end it. Raises `StartFailed` if it dies again and again."""
        stopping = asyncio.create_task(stop.wait())
        while not stop.is_set():
            started_s = time.monotonic()
            with self.log_path.open("ab") as log:
                child = await asyncio.create_subprocess_exec(
                    *self.command,
                    stdin=asyncio.subprocess.DEVNULL,
                    stdout=log,
                    stderr=log,
                    env=dict(self.environment),
                    # A session of its own: Ctrl-C reaches the supervisor alone, which then ends things in
                    # order.
                    start_new_session=True,
                    preexec_fn=_end_with_parent if sys.platform == "linux" else None,
                )
            ended = asyncio.create_task(child.wait())
            try:
                await asyncio.wait({ended, stopping}, return_when=asyncio.FIRST_COMPLETED)
            finally:
                await _end(child)
            if not stop.is_set():
                self._count_death(lived_s=time.monotonic() - started_s)
        stopping.cancel()

    def _count_death(self, *, lived_s: float) -> None:
        self.n_quick_deaths = self.n_quick_deaths + 1 if lived_s < QUICK_S else 0
        if self.n_quick_deaths >= MAX_QUICK_DEATHS:
            tail = "\n".join(self.log_path.read_text(errors="replace").splitlines()[-20:])
            raise StartFailed(
                f"The {self.name} process ended {MAX_QUICK_DEATHS} times within {QUICK_S:g} s of its start. "
                f"It said last ({self.log_path}):\n{tail}"
            )


def _end_with_parent() -> None:
    # Before the child's program starts: ask the kernel for SIGTERM should the supervisor vanish.
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


async def _end(child: asyncio.subprocess.Process) -> None:
    if child.returncode is None:
        with contextlib.suppress(ProcessLookupError):
            child.terminate()
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(child.wait(), timeout=TIMEOUT_S)
    # Its own children (a worker's readers) outlive a process that was killed.
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(child.pid, signal.SIGKILL)
    await child.wait()


def port_is_free(host: str, port: int) -> bool:
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError:
            return False
        return True


async def _listening(host: str, port: int) -> None:
    """Wait until something accepts connections. Raises `TimeoutError`."""
    async with asyncio.timeout(TIMEOUT_S):
        while True:
            try:
                _, writer = await asyncio.open_connection(host, port)
            except OSError:
                await asyncio.sleep(0.1)
            else:
                writer.close()
                await writer.wait_closed()
                return


async def supervise(processes: Sequence[Process], *, host: str, port: int, ready: Callable[[], None]) -> None:
    """Run the processes until SIGINT, SIGTERM or SIGHUP, or until one does not stay up; then end them.

    Calls `ready` once the port answers. Raises `StartFailed`.
    """
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        loop.add_signal_handler(number, stop.set)
    running = [asyncio.create_task(process.run(stop)) for process in processes]
    listening = asyncio.create_task(_listening(host, port))
    stopping = asyncio.create_task(stop.wait())
    try:
        await asyncio.wait({listening, stopping, *running}, return_when=asyncio.FIRST_COMPLETED)
        if listening.done() and not listening.exception():
            ready()
        await asyncio.wait(running, return_when=asyncio.FIRST_EXCEPTION)
    finally:
        stop.set()
        listening.cancel()
        outcomes = await asyncio.gather(*running, return_exceptions=True)
        stopping.cancel()
    for outcome in outcomes:
        if isinstance(outcome, BaseException):
            raise outcome
