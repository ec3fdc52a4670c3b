"""What holds when many do the same at once, each on a connection of its own (SQLite has one writer)."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier
from typing import TypeVar

import pytest
from django.db import connection

from leaderboard import audit

T = TypeVar("T")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.services,
    pytest.mark.django_db(transaction=True),
    pytest.mark.skipif(
        "connection.vendor != 'postgresql'", reason="runs with: python -m tests.on_postgresql"
    ),
]


def at_once(n: int, deed: Callable[[int], T]) -> list[T]:
    """Do it `n` times, each in a thread with a connection of its own, all let go at the same time."""
    barrier = Barrier(n, timeout=60)

    def one(number: int) -> T:
        try:
            connection.ensure_connection()
            barrier.wait()
            return deed(number)
        finally:
            connection.close()

    with ThreadPoolExecutor(n) as pool:
        return list(pool.map(one, range(n)))


def test_twenty_writers_of_fifty_events_each_keep_one_unbroken_chain() -> None:
    def write(writer: int) -> None:
        for number in range(50):
            audit.record(verb="tried", noun="Door", noun_id=f"{writer}-{number}")

    at_once(20, write)
    found = audit.verify()
    assert (found.n_events, found.breaks) == (1000, ())
    assert len(set(audit.events().values_list("noun_id", flat=True))) == 1000
