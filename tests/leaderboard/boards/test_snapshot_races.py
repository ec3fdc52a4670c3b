"""Boards that change while many read them, each on a connection of its own (SQLite has one writer)."""

import itertools
import threading
from pathlib import Path
from typing import Any

import pytest
from django.db import connection, transaction
from django.test import Client

from leaderboard import board_versions
from leaderboard.boards import snapshots
from leaderboard.models import Score, User
from tests import board_rows, builders
from tests.services import ON_POSTGRESQL

API = "/api/v1/splits/test/board"
pytestmark = [pytest.mark.slow, *ON_POSTGRESQL]


def test_no_reader_gets_a_board_that_is_half_changed(benchmark: None, tmp_path: Path, owner: User) -> None:
    edition = builders.import_truth(tmp_path)
    board_rows.fill(edition, n=20, user=owner)
    stopping, faults, n_read = threading.Event(), [], [0] * 3

    def read(reader: int) -> None:
        client = Client()
        while not stopping.is_set():
            entries = client.get(API).json()["entries"]
            shown = {(e["scores"]["mid"], e["scores"]["rte"]) for e in entries if e["kind"] == "submission"}
            if len(shown) != 1 and None not in shown:
                faults.append(shown)
            n_read[reader] += 1
        connection.close()

    def set_all(value: float) -> None:
        with transaction.atomic():
            Score.objects.filter(ttc_range="overall", metric="mid").update(value=value)
            Score.objects.filter(ttc_range="overall", metric="rte").update(value=value)
            board_versions.bump("test")

    set_all(1.0)
    readers = [threading.Thread(target=read, args=(i,)) for i in range(3)]
    for thread in readers:
        thread.start()
    try:
        # Each reader has its turn, however busy the machine is, or has ended with a fault of its own.
        for round_ in itertools.count():
            if round_ >= 12 and (min(n_read) > 0 or not all(thread.is_alive() for thread in readers)):
                break
            set_all(2.0 + round_)
            answered = {
                e["scores"]["mid"] for e in Client().get(API).json()["entries"] if e["kind"] == "submission"
            }
            assert answered == {2.0 + round_}
    finally:
        stopping.set()
        for thread in readers:
            thread.join()
    assert faults == []
    assert min(n_read) > 0


def test_board_is_of_one_moment_although_it_takes_several_statements(
    benchmark: None, tmp_path: Path, owner: User
) -> None:
    edition = builders.import_truth(tmp_path)
    board_rows.fill(edition, n=2, user=owner)
    changed: list[str] = []

    def change() -> None:
        Score.objects.update(value=99.0)
        connection.close()

    def meanwhile(execute: Any, sql: str, *rest: Any) -> Any:
        # After the rows, before their scores.
        if 'FROM "leaderboard_score"' in sql and not changed:
            changed.append(sql)
            other = threading.Thread(target=change)
            other.start()
            other.join()
        return execute(sql, *rest)

    with connection.execute_wrapper(meanwhile):
        entries = snapshots.shown(split=edition.split, edition=edition).entries
    assert changed
    assert 99.0 not in {value for entry in entries for value in entry.scores.values()}
