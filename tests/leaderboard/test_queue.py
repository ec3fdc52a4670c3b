"""`leaderboard.queue`: what waits is found again, with or without a broker."""

import os
import random
import subprocess
import sys
import threading
import uuid
from collections.abc import Iterator

import pytest
from django.db import connections
from pytest_django import Settings

from leaderboard import broker, health, lifecycle, queue, scoring
from leaderboard.models import Edition, Evaluation, Status, User
from leaderboard.queue import Poller
from tests import builders
from tests.leaderboard import queue_rows

PATIENCE_S = 60


@pytest.fixture
def nudged(monkeypatch: pytest.MonkeyPatch) -> list[uuid.UUID]:
    """The evaluations that a broker was told of; this one takes three messages and then no more."""
    taken: list[uuid.UUID] = []

    def nudge(evaluation_id: uuid.UUID) -> bool:
        taken.append(evaluation_id)
        return len(taken) <= 3

    monkeypatch.setattr(broker, "nudge", nudge)
    return taken


def test_sweep_takes_back_what_dead_workers_hold(
    edition: Edition, owner: User, nudged: list[uuid.UUID]
) -> None:
    queue_rows.queued(edition, owner)
    lease = queue_rows.claim()
    queue_rows.expire(lease)
    queue.sweep(rng=random.Random(0))
    assert queue_rows.row(lease).status == Status.QUEUED


def test_sweep_nudges_again_what_is_due_and_nothing_else(
    edition: Edition, owner: User, nudged: list[uuid.UUID]
) -> None:
    running, first, second = (queue_rows.queued(edition, owner) for _ in range(3))
    assert queue_rows.claim().evaluation_id == running.pk
    assert queue.sweep(rng=random.Random(0)) == 2
    assert nudged == [first.pk, second.pk]


def test_sweep_does_not_wait_for_a_silent_broker_again_and_again(
    edition: Edition, owner: User, nudged: list[uuid.UUID]
) -> None:
    for _ in range(6):
        queue_rows.queued(edition, owner)
    assert queue.sweep(rng=random.Random(0)) == 3
    assert len(nudged) == 4


def test_a_sweep_is_written_down_also_when_the_broker_is_silent(
    edition: Edition, owner: User, nudged: list[uuid.UUID]
) -> None:
    assert health.sweep_age_s() is None
    for _ in range(6):
        queue_rows.queued(edition, owner)
    queue.sweep(rng=random.Random(0))
    assert health.sweep_age_s() is not None


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


@pytest.fixture
def own_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    """A look closes its thread's connections; these tests look from the thread of their transaction."""
    monkeypatch.setattr(connections, "close_all", lambda: None)


@pytest.mark.usefixtures("own_connection")
def test_a_look_decides_everything_that_waits(edition: Edition, owner: User) -> None:
    for factor in (1.1, 1.2, 1.3):
        builders.submit(owner, builders.predictions(edition, factor=factor))
    assert queue.look_for_work(rng=random.Random(0), stopping=threading.Event()) == 3
    assert set(Evaluation.objects.values_list("status", flat=True)) == {Status.SCORED}


@pytest.mark.usefixtures("own_connection")
def test_a_look_begins_nothing_once_it_is_told_to_stop(edition: Edition, owner: User) -> None:
    builders.submit(owner, builders.predictions(edition))
    stopping = threading.Event()
    stopping.set()
    assert queue.look_for_work(rng=random.Random(0), stopping=stopping) == 0
    assert Evaluation.objects.get().status == Status.QUEUED


@pytest.fixture
def poller(settings: Settings, monkeypatch: pytest.MonkeyPatch) -> Iterator[Poller]:
    """A poller in a hurry. It ends before `monkeypatch` ends, and so never looks at anything real."""
    settings.POLL_S = 0.01
    poller = Poller(rng=random.Random(0))
    yield poller
    poller.stop(patience_s=PATIENCE_S)
    assert not poller.is_alive()


def test_poller_looks_again_after_a_look_that_broke(poller: Poller, monkeypatch: pytest.MonkeyPatch) -> None:
    looked_again = threading.Event()
    broken: list[str] = []
    faults = iter([KeyError("a fault that nobody foresaw")])

    def release_expired(*, rng: random.Random) -> int:
        for fault in faults:
            raise fault
        looked_again.set()
        return 0

    monkeypatch.setattr(threading, "excepthook", lambda hook: broken.append(repr(hook.exc_value)))
    monkeypatch.setattr(lifecycle, "release_expired", release_expired)
    monkeypatch.setattr(scoring, "run_next", lambda *, rng: False)
    monkeypatch.setattr(queue, "work_behind", lambda *, rng, stopping: 0)
    poller.start()
    assert looked_again.wait(PATIENCE_S)
    assert broken == ["KeyError('a fault that nobody foresaw')"]


def test_poller_finishes_what_is_in_hand_before_it_stops(
    poller: Poller, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, may_finish, finished = threading.Event(), threading.Event(), threading.Event()

    def run_next(*, rng: random.Random) -> bool:
        begun.set()
        may_finish.wait(PATIENCE_S)
        finished.set()
        return True

    monkeypatch.setattr(lifecycle, "release_expired", lambda *, rng: 0)
    monkeypatch.setattr(scoring, "run_next", run_next)
    poller.start()
    assert begun.wait(PATIENCE_S)
    stop = threading.Thread(target=poller.stop, kwargs={"patience_s": PATIENCE_S})
    stop.start()
    assert not finished.is_set()
    may_finish.set()
    stop.join(PATIENCE_S)
    assert finished.is_set()
    assert not poller.is_alive()
