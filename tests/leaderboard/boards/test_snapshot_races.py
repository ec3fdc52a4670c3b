"""Boards that change while many read them, each on a connection of its own (SQLite has one writer)."""

import itertools
import threading
from pathlib import Path

import pytest
from django.db import connection, transaction
from django.test import Client

from leaderboard import board_versions
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
