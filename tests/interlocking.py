"""Two transactions brought to the point where they could wait for each other, on PostgreSQL.

The first is held right after one of its statements, with every lock that it has taken by then. The second
runs until it is finished, or waits for one of these locks. Then the first goes on. So what happens does not
depend on chance, and a deadlock that the two can have at that statement is had.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from queue import SimpleQueue
from threading import Event
from typing import Any, NamedTuple

from django.db import connection

Action = Callable[[], object]
# Whether a statement is where to hold: by its number within the action's transactions, and by its text.
PausePoint = Callable[[int, str], bool]
TIMEOUT_S = 180.0
LOOK_EVERY_S = 0.001


@dataclass
class Hold:
    """Holds a transaction after the first statement that `is_here` knows; keeps the text of all of them."""

    is_here: PausePoint
    statements: list[str] = field(default_factory=list)
    is_paused: bool = False
    reached: Event = field(default_factory=Event)
    may_go_on: Event = field(default_factory=Event)

    def __call__(self, execute: Callable[..., Any], sql: str, *rest: Any) -> Any:
        """One statement, and perhaps a rest after it."""
        result = execute(sql, *rest)
        if connection.in_atomic_block:
            self.statements.append(sql)
            if not self.is_paused and self.is_here(len(self.statements), sql):
                self.is_paused = True
                self.reached.set()
                assert self.may_go_on.wait(TIMEOUT_S)
        return result


class Outcome(NamedTuple):
    """The fault of each of two actions, or None, and how they met."""

    faults: tuple[BaseException | None, ...]
    was_paused: bool  # the first
    has_waited: bool  # the second


def meet(first: Action, second: Action, *, at: PausePoint) -> Outcome:
    """Hold `first` where `at` says, let `second` run until it ends or waits, and let both end."""
    hold, pids = Hold(at), SimpleQueue[int]()

    def run_first() -> None:
        try:
            with connection.execute_wrapper(hold):
                first()
        finally:
            hold.reached.set()
            connection.close()

    def run_second() -> None:
        try:
            with connection.cursor() as cursor:
                cursor.execute("SELECT pg_backend_pid()")
                pids.put(cursor.fetchone()[0])
            second()
        finally:
            connection.close()

    with ThreadPoolExecutor(2) as threads:
        actions = [threads.submit(run_first)]
        assert hold.reached.wait(TIMEOUT_S)
        actions.append(threads.submit(run_second))
        pid = pids.get(timeout=TIMEOUT_S)
        while not actions[1].done() and not _is_waiting(pid):
            wait(actions[1:], timeout=LOOK_EVERY_S)
        has_waited = not actions[1].done()
        hold.may_go_on.set()
        return Outcome(tuple(action.exception(TIMEOUT_S) for action in actions), hold.is_paused, has_waited)


def _is_waiting(pid: int) -> bool:
    with connection.cursor() as cursor:
        cursor.execute("SELECT EXISTS (SELECT FROM pg_locks WHERE pid = %s AND NOT granted)", [pid])
        return bool(cursor.fetchone()[0])
