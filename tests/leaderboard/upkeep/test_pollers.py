"""`leaderboard.upkeep.pollers`: what waits is found again, with or without a broker."""

import os
import random
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime, timedelta
from typing import Any

import pytest
from django.db import connection, connections
from django.utils import timezone

from leaderboard import board_versions
from leaderboard.models import Edition, Evaluation, Status, SweepBeat, User
from leaderboard.ops import health
from leaderboard.upkeep import pollers
from leaderboard.upkeep.pollers import Poller
from tests import builders
from tests.leaderboard.web.maintain import queue_rows

TIMEOUT_S = 180


def test_sweep_takes_back_what_dead_workers_hold(edition: Edition, owner: User) -> None:
    queue_rows.queued(edition, owner)
    lease = queue_rows.claim()
    queue_rows.expire(lease)
    pollers.sweep(rng=random.Random(0))
    assert queue_rows.row(lease).status == Status.QUEUED


def keep_up(n: int, *, hours_ago: float) -> None:
    """Let `n` workers ask whether it is their turn, after the last time was so long ago."""
    before = timezone.now() - timedelta(hours=hours_ago)
    SweepBeat.objects.update(sweep_begun_at=before, clean_begun_at=before, mails_begun_at=before)
    for _ in range(n):
        pollers.keep_up(rng=random.Random(0), stopping=threading.Event())


@pytest.fixture
def done(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The times that something was swept, and cleaned."""
    done: list[str] = []
    monkeypatch.setattr(pollers, "sweep", lambda *, rng: done.append("swept"))
    monkeypatch.setattr(pollers, "clean", lambda *, now: done.append("cleaned"))
    return done


def test_of_many_workers_one_sweeps_and_one_cleans_when_it_is_time(db: None, done: list[str]) -> None:
    keep_up(3, hours_ago=0)
    assert done == ["swept", "cleaned"], "the first of all"
    keep_up(3, hours_ago=0)
    keep_up(3, hours_ago=1)
    assert done[2:] == ["swept"]
    keep_up(3, hours_ago=7)
    assert done[3:] == ["swept", "cleaned"]


@pytest.mark.django_db(transaction=True)
def test_workers_that_ask_at_the_same_moment_sweep_once(done: list[str]) -> None:
    keep_up(1, hours_ago=1)
    done.clear()
    SweepBeat.objects.update(sweep_begun_at=timezone.now() - timedelta(hours=1))
    all_have_looked = threading.Barrier(6)

    def after_all_looks(execute: Callable[..., Any], sql: str, *rest: Any) -> Any:
        if sql.startswith("UPDATE") and "sweep_begun_at" in sql:
            all_have_looked.wait(TIMEOUT_S)
        return execute(sql, *rest)

    def ask() -> None:
        with connection.execute_wrapper(after_all_looks):
            pollers.keep_up(rng=random.Random(0), stopping=threading.Event())
        connections.close_all()

    asking = [threading.Thread(target=ask) for _ in range(6)]
    for thread in asking:
        thread.start()
    for thread in asking:
        thread.join(TIMEOUT_S)
    assert done == ["swept"]


def test_a_sweep_that_breaks_is_not_written_down_and_keeps_nothing_else_waiting(
    db: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def break_off(*, now: datetime) -> int:
        raise OSError("no space left on device")

    monkeypatch.setattr(board_versions, "bump_passed_deadlines", break_off)
    with pytest.raises(OSError, match="no space"):
        pollers.keep_up(rng=random.Random(0), stopping=threading.Event())
    assert health.sweep_age_s() is None, "so that /readyz goes on saying that nobody sweeps"
    pollers.keep_up(rng=random.Random(0), stopping=threading.Event())
    assert SweepBeat.objects.exclude(cleaned_at=None).exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    "times",
    [
        {"TSTTC_LEASE_S": "300", "TSTTC_HEARTBEAT_S": "15"},
        {"TSTTC_LEASE_S": "10", "TSTTC_HEARTBEAT_S": "10"},
        {"TSTTC_HEARTBEAT_S": "0"},
    ],
)
def test_times_that_could_not_tell_a_dead_worker_from_a_long_run_are_refused(times: dict[str, str]) -> None:
    done = subprocess.run(
        [sys.executable, "-c", "import leaderboard.settings"],
        env=os.environ | times,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "expected each to be shorter than the next" in done.stderr


@pytest.mark.slow
def test_a_worker_that_lacks_a_library_does_not_start() -> None:
    start = "import sys; sys.modules['numpy'] = None; import leaderboard.celery as worker; "
    done = subprocess.run(
        [sys.executable, "-c", start + "worker.app.loader.import_default_modules()"],
        env=os.environ,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "import of numpy halted" in done.stderr


@pytest.mark.slow
def test_a_worker_keeps_its_memory_private() -> None:
    """Celery says `worker_init` before it forks the processes that run tasks, which inherit it."""
    start = "import ctypes, leaderboard.celery; from celery.signals import worker_init; "
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            start + "worker_init.send(None); print(ctypes.CDLL(None).prctl(3, 0, 0, 0, 0))",
        ],
        env=os.environ,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "0\n"


@pytest.mark.slow
def test_a_look_decides_everything_that_waits(edition: Edition, owner: User) -> None:
    for factor in (1.1, 1.2, 1.3):
        builders.submit(owner, builders.predictions(edition, factor=factor))
    assert pollers.poll(rng=random.Random(0), stopping=threading.Event()) == 3
    assert set(Evaluation.objects.values_list("status", flat=True)) == {Status.SCORED}


def test_a_look_begins_nothing_once_it_is_to_stop(edition: Edition, owner: User) -> None:
    builders.submit(owner, builders.predictions(edition))
    stopping = threading.Event()
    stopping.set()
    assert pollers.poll(rng=random.Random(0), stopping=stopping) == 0
    assert Evaluation.objects.get().status == Status.QUEUED


@contextmanager
def polling(act: Callable[..., object]) -> Iterator[Poller]:
    """A poller in a hurry, which has ended when the context ends."""
    poller = Poller(act, every_s=0.01, rng=random.Random(0))
    poller.start()
    yield poller
    pollers.stop_pollers([poller], timeout_s=TIMEOUT_S)
    assert not poller.is_alive()


def test_poller_looks_again_after_a_look_that_broke() -> None:
    looked_again = threading.Event()
    faults: Iterator[Exception] = iter([KeyError("a fault that nobody foresaw"), OSError("no route to host")])

    def look(*, rng: random.Random, stopping: threading.Event) -> None:
        for fault in faults:
            raise fault
        looked_again.set()

    with polling(look):
        assert looked_again.wait(TIMEOUT_S)


def test_poller_finishes_what_is_in_hand_before_it_stops() -> None:
    begun, may_finish, finished = threading.Event(), threading.Event(), threading.Event()

    def look(*, rng: random.Random, stopping: threading.Event) -> None:
        begun.set()
        assert stopping.wait(TIMEOUT_S), "it is told that it is to end"
        may_finish.wait(TIMEOUT_S)
        finished.set()

    with polling(look) as poller:
        assert begun.wait(TIMEOUT_S)
        stop = threading.Thread(
            target=pollers.stop_pollers, args=([poller],), kwargs={"timeout_s": TIMEOUT_S}
        )
        stop.start()
        assert not finished.is_set()
        may_finish.set()
        stop.join(TIMEOUT_S)
        assert finished.is_set()
