"""Work on many rows, by one process or several, each with its own worker."""

# All processes hold one end of a pipe, and end when the parent closes the other end or ends.

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from typing import Any, Final, TypeVar

import cv2

MAX_ROWS: Final = 32
"""Rows that a process takes at once: neighbours, which share frames; fewer where there are few in all."""

_N_PIECES: Final = 4
"""Pieces for each process, at least, so that none waits long for another at the end."""

_MIN_ROWS: Final = 8
"""Rows for which a process is started; fewer are done sooner than it starts."""

HEARTBEAT_S: Final = 1.0

Result = TypeVar("Result")
Worker = Callable[[int], Result]


class WorkerEnded(RuntimeError):
    """A process that ended during its work, usually out of memory."""


def worked_through(
    make: Callable[[], Worker[Result]], rows: Sequence[int], *, n_processes: int
) -> Generator[Sequence[Result], None, None]:
    """Yield the worker's results in pieces, as they are ready; empty ones every `HEARTBEAT_S`.

    With several processes, `make` must be picklable and the main module importable. Raises `WorkerEnded`.
    Close the iterator (`contextlib.closing`), or its processes continue.
    """
    n_processes = min(n_processes, -(-len(rows) // _MIN_ROWS))
    if n_processes <= 1:
        worker = make()
        for row in rows:
            yield [worker(row)]
        return
    n_rows = max(1, min(MAX_ROWS, len(rows) // (_N_PIECES * n_processes)))
    pieces = _pieces(rows, n_processes=n_processes, most=n_rows)
    context = multiprocessing.get_context("spawn")
    theirs, ours = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(n_processes, mp_context=context, initializer=_start, initargs=(make, theirs))
    with theirs, ours:
        try:
            yield from _in_turn(pool, pieces, n_ahead=2 * n_processes)
        except BrokenProcessPool:
            raise WorkerEnded from None
        except BaseException:
            ours.close()
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _pieces(rows: Sequence[int], *, n_processes: int, most: int) -> list[Sequence[int]]:
    """The rows in pieces of 1, 2, 4, … and then `most`, so that the first results come soon.

    >>> [len(piece) for piece in _pieces(range(30), n_processes=2, most=8)]
    [1, 1, 2, 2, 4, 4, 8, 8]
    """
    pieces: list[Sequence[int]] = []
    start = 0
    while start < len(rows):
        n_rows = min(most, 2 ** (len(pieces) // n_processes))
        pieces.append(rows[start : start + n_rows])
        start += n_rows
    return pieces


def _in_turn(
    pool: ProcessPoolExecutor, pieces: Sequence[Sequence[int]], *, n_ahead: int
) -> Iterator[Sequence[Any]]:
    # Few pieces are handed out ahead, so that neither queue grows.
    left = iter(pieces)
    open_pieces: set[Future[list[Any]]] = set()
    while True:
        while len(open_pieces) < n_ahead and (piece := next(left, None)) is not None:
            with _interrupts_blocked():
                open_pieces.add(pool.submit(_work, piece))
        if not open_pieces:
            return
        done, open_pieces = wait(open_pieces, timeout=HEARTBEAT_S, return_when=FIRST_COMPLETED)
        if not done:
            yield []
        for future in done:
            yield future.result()


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Keep Ctrl-C, which is for the parent, from processes that start meanwhile; not on Windows."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


# --- in the processes --------------------------------------------------------------------------------------

_workers: list[Worker[Any]] = []


def _start(make: Callable[[], Worker[Any]], theirs: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # for Windows
    threading.Thread(target=_end_with, args=(theirs,), daemon=True).start()
    cv2.setNumThreads(1)
    _workers[:] = [make()]
    if torch := sys.modules.get("torch"):  # of the method: as many threads as processors, in each process
        torch.set_num_threads(1)


def _end_with(theirs: Connection) -> None:
    """End this process when the other end of the pipe is closed."""
    with suppress(EOFError, OSError):
        theirs.recv_bytes()
    os._exit(1)


def _work(rows: Sequence[int]) -> list[Any]:
    [worker] = _workers
    return [worker(row) for row in rows]
