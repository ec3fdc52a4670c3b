"""Transactions brought to the point where they could wait for each other, on PostgreSQL.

The first is held right after one of its statements, with every lock that it has taken by then. Another runs
until it is finished, or waits for one of these locks. Then the first goes on. So what happens does not depend
on chance, and a deadlock that the two can have at that statement is had.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import nullcontext
from dataclasses import dataclass
from threading import Event
from types import TracebackType
from typing import Any, Self

from django.db import connection

Deed = Callable[[], object]
# Whether a statement is where to hold: by its number within the deed's transactions, and by its text.
Place = Callable[[int, str], bool]
# The last lock that a verb takes which changes a board.
BOARD_LOCK = "SET CONSTRAINTS ALL IMMEDIATE"
EVENT = 'INSERT INTO "leaderboard_auditevent"'
PATIENCE_S = 180.0
LOOK_EVERY_S = 0.001


class Hold:
    """Holds a transaction after the first statement that `is_here` knows by its number and its text."""

    def __init__(self, is_here: Place) -> None:
        self.is_here = is_here
        self.n_statements = 0
        self.is_held = False
        self.reached, self.may_go_on = Event(), Event()

    def __call__(self, execute: Callable[..., Any], sql: str, *rest: Any) -> Any:
        """One statement, and perhaps a rest after it."""
        result = execute(sql, *rest)
        if not connection.in_atomic_block:
            return result
        self.n_statements += 1
        if not self.is_held and self.is_here(self.n_statements, sql):
            self.is_held = True
            self.reached.set()
            assert self.may_go_on.wait(PATIENCE_S)
        return result


@dataclass(frozen=True)
class Outcome:
    """What came of deeds against each other: the fault of each or None, the first one's first."""

    faults: tuple[BaseException | None, ...]
    n_statements: int  # of the first
    was_held: bool
    n_waited: int  # of the others, for the first or for each other


class Meeting:
    """Threads with a connection each, of which one does its deed against the others'."""

    def __init__(self, n_others: int) -> None:
        self._threads = [ThreadPoolExecutor(1) for _ in range(1 + n_others)]
        self._pids: list[int] = []

    def __enter__(self) -> Self:
        self._pids = [thread.submit(_connected).result(PATIENCE_S) for thread in self._threads]
        return self

    def __exit__(
        self, kind: type[BaseException] | None, fault: BaseException | None, where: TracebackType | None
    ) -> None:
        for thread in self._threads:
            thread.submit(_closed).result(PATIENCE_S)
            thread.shutdown()

    def of(self, first: Deed, *others: Deed, at: Place) -> Outcome:
        """Hold `first` where `at` says; begin each other when the one before ends or waits; let all end."""
        hold = Hold(at)
        deeds = [self._threads[0].submit(_done, first, hold)]
        assert hold.reached.wait(PATIENCE_S)
        n_waited = 0
        for other, thread, pid in zip(others, self._threads[1:], self._pids[1:], strict=False):
            deeds.append(thread.submit(_done, other, None))
            while not deeds[-1].done() and not _is_waiting(pid):
                wait(deeds[-1:], timeout=LOOK_EVERY_S)
            n_waited += not deeds[-1].done()
        hold.may_go_on.set()
        return Outcome(
            faults=tuple(deed.exception(PATIENCE_S) for deed in deeds),
            n_statements=hold.n_statements,
            was_held=hold.is_held,
            n_waited=n_waited,
        )


def at_the_board_lock(number: int, sql: str) -> bool:
    """Where a verb that changes a board holds everything that it will hold."""
    return BOARD_LOCK in sql


def at_the_event(number: int, sql: str) -> bool:
    """Where another verb does, and its foreign keys are still unchecked."""
    return EVENT in sql


def _done(deed: Deed, hold: Hold | None) -> None:
    try:
        with connection.execute_wrapper(hold) if hold else nullcontext():
            deed()
    finally:
        if hold is not None:
            hold.reached.set()


def _connected() -> int:
    connection.ensure_connection()
    with connection.cursor() as cursor:
        # What is tested is who waits for whom; that a COMMIT is on the disk others test.
        cursor.execute("SET synchronous_commit TO off")
        cursor.execute("SELECT pg_backend_pid()")
        pid: int = cursor.fetchone()[0]
    return pid


def _closed() -> None:
    connection.close()


def _is_waiting(pid: int) -> bool:
    with connection.cursor() as cursor:
        cursor.execute("SELECT EXISTS (SELECT FROM pg_locks WHERE pid = %s AND NOT granted)", [pid])
        return bool(cursor.fetchone()[0])
