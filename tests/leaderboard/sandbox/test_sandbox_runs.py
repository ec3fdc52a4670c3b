"""A run that goes wrong: who is blamed, how often it is tried, and that the next file does not notice."""

import os
import random
import signal
from collections import deque
from datetime import timedelta
from pathlib import Path

import pytest
from django.db import InterfaceError, OperationalError
from django.utils import timezone
from pytest_django import Settings

from evaluator.scoring.scores import Scorer
from leaderboard.models import Edition, Evaluation, Status, Submission, User
from leaderboard.queue import lifecycle, worker
from leaderboard.queue.lifecycle import MAX_POISON_STRIKES, Lease
from leaderboard.queue.worker import Heartbeat
from leaderboard.sandbox import fork_server
from leaderboard.storage import files, truth_values
from leaderboard.submissions.progress import progress_of
from tests import builders
from tests.chaos.processes import REPOSITORY
from tests.chaos.uploads import bomb_file, reader_memory_bytes
from tests.leaderboard.sandbox.child_processes import children
from tests.leaderboard.web.maintain import queue_rows
from tests.leaderboard.web.maintain.queue_rows import LEASE_S, WALL_S

pytestmark = pytest.mark.slow


def run_next() -> bool:
    """The evaluation that is due now, whatever its backoff."""
    queue_rows.make_due()
    return worker.run_next(rng=random.Random(0))


def hang_the_reading() -> None:
    """Stop the process that forks readers: the next file is not read before its run ends."""
    os.kill(fork_server.server_of_this_thread(python_path=REPOSITORY).pid, signal.SIGSTOP)


def evaluation_of(submission: Submission) -> Evaluation:
    return Evaluation.objects.get(submission=submission)


def strikes(submission: Submission) -> tuple[int, int]:
    """Against the file, and against the machine."""
    row = evaluation_of(submission)
    return row.n_poison_strikes, row.n_infrastructure_strikes


def test_file_that_kills_its_reader_is_tried_again_behind_the_next_and_given_up_after_three_runs(
    edition: Edition, owner: User, settings: Settings, tmp_path: Path
) -> None:
    truth = truth_values.load(edition.ground_truth_id)
    settings.CHILD_MEMORY_BYTES = reader_memory_bytes(truth, directory=tmp_path)
    bomb = builders.submit(owner, bomb_file(0), method="Bomb")
    healthy = builders.submit(owner, builders.predictions(edition), method="Healthy")
    assert run_next()
    assert strikes(bomb) == (1, 0)
    assert run_next()
    assert progress_of(healthy).state == Status.SCORED
    assert strikes(bomb) == (1, 0)
    for _ in range(1, MAX_POISON_STRIKES):
        assert run_next()
    assert strikes(bomb) == (MAX_POISON_STRIKES, 0)
    assert progress_of(bomb).state == Status.SYSTEM_ERROR
    assert progress_of(bomb).fault_is_ours
    assert not run_next()


def test_file_that_takes_too_much_processor_time_is_read_once_and_its_team_reads_why(
    edition: Edition, owner: User, settings: Settings
) -> None:
    # No time at all: the reader's first tick of processor time is one too many.
    settings.CHILD_CPU_S = 0
    hostile = b"anno_id,ttc\n" + b"".join(b"%d,x\n" % i for i in range(100_000))
    slow = builders.submit(owner, hostile, method="Slow")
    assert run_next()
    while strikes(slow)[0] == 0:
        # On a busy machine that tick can come before the reader is ready, which is no fault of the file.
        Evaluation.objects.update(due_at=timezone.now() - timedelta(seconds=1))
        assert run_next()
    assert strikes(slow)[0] == 1
    assert not run_next()
    assert progress_of(slow).state == Status.SYSTEM_ERROR
    assert progress_of(slow).fault_is_ours
    assert progress_of(slow).sentence == (
        "Reading the file took more processor time than a file for this split may take, so it was not "
        "scored; `tsttc check` reads it on your machine without this limit. We keep the file, and a "
        "maintainer can have it read again. Until then it counts as a rejected file for 24 hours."
    )


def test_run_that_takes_too_long_is_ended_and_counts_against_the_file(
    edition: Edition, owner: User, settings: Settings
) -> None:
    settings.WALL_S, settings.LEASE_S, settings.HEARTBEAT_S = 0.3, 0.1, 0.02
    submission = builders.submit(owner, builders.predictions(edition))
    hang_the_reading()
    assert run_next()
    assert not children()
    assert strikes(submission) == (1, 0)
    assert evaluation_of(submission).last_error == "the run reached its time limit or was taken away"


def test_file_that_the_store_has_lost_is_not_blamed(edition: Edition, owner: User) -> None:
    submission = builders.submit(owner, builders.predictions(edition))
    files.store().delete(files.predictions_name(submission.digest))
    assert run_next()
    assert strikes(submission) == (0, 1)
    assert "the file store lacks a file" in evaluation_of(submission).last_error


@pytest.mark.parametrize("change", ["another value", "no JSON", "cut off", "empty"])
def test_file_that_the_store_has_damaged_is_not_blamed(edition: Edition, owner: User, change: str) -> None:
    data = builders.predictions(edition)
    submission = builders.submit(owner, data)
    damaged = {"another value": data.replace(b"1", b"2", 1), "no JSON": b"\x00" + data, "cut off": data[:99]}
    Path(files.store().path(files.predictions_name(submission.digest))).write_bytes(damaged.get(change, b""))
    assert run_next()
    assert strikes(submission) == (0, 1)
    assert evaluation_of(submission).status == Status.QUEUED
    assert "the file store has other bytes" in evaluation_of(submission).last_error
    Path(files.store().path(files.predictions_name(submission.digest))).write_bytes(data)
    queue_rows.make_due()
    builders.score_all()
    assert evaluation_of(submission).status == Status.SCORED


def test_damaged_ground_truth_does_not_count_against_the_file(edition: Edition, owner: User) -> None:
    submission = builders.submit(owner, builders.predictions(edition))
    truth_values.load.cache_clear()
    truth_values.values_path(edition.ground_truth_id).write_bytes(b"no archive")
    try:
        assert run_next()
    finally:
        truth_values.load.cache_clear()
    assert strikes(submission) == (0, 1)
    assert "cannot be used" in evaluation_of(submission).last_error


def test_reader_that_cannot_start_does_not_count_against_the_file(edition: Edition, owner: User) -> None:
    submission = builders.submit(owner, builders.predictions(edition))
    truth_values.manifest_path(edition.ground_truth_id).unlink()
    assert run_next()
    assert strikes(submission) == (0, 1)
    assert "did not start" in evaluation_of(submission).last_error


def test_fault_of_our_own_is_a_strike_at_once_and_ends_no_worker(
    edition: Edition, owner: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    submission = builders.submit(owner, builders.predictions(edition))
    with monkeypatch.context() as patch:
        patch.setattr(Scorer, "report", lambda *_, **__: 1 / 0)
        assert run_next()
    assert strikes(submission) == (1, 0)
    assert evaluation_of(submission).last_error == "ZeroDivisionError: division by zero"
    assert run_next()
    assert progress_of(submission).state == Status.SCORED


def test_outcome_that_the_database_refuses_is_a_strike_and_leaves_nothing(
    edition: Edition, owner: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    submission = builders.submit(owner, builders.predictions(edition))
    monkeypatch.setattr(worker, "rounded", lambda value, *, decimals: -1.0)
    assert run_next()
    assert strikes(submission) == (1, 0)
    assert evaluation_of(submission).scores.count() == 0
    assert evaluation_of(submission).status == Status.QUEUED


def test_cancelled_run_is_dropped_without_a_strike(
    edition: Edition, owner: User, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings.HEARTBEAT_S = 0.02
    submission = builders.submit(owner, builders.predictions(edition))
    real = lifecycle.heartbeat

    def cancel_then_beat(lease: Lease, *, lease_s: float) -> bool:
        lifecycle.cancel(submission=submission, actor=owner)
        return real(lease, lease_s=lease_s)

    monkeypatch.setattr(lifecycle, "heartbeat", cancel_then_beat)
    hang_the_reading()
    assert run_next()
    assert strikes(submission) == (0, 0)
    assert evaluation_of(submission).status == Status.CANCELLED


# --- the heartbeat ---------------------------------------------------------------------------------------


@pytest.fixture
def leases(edition: Edition, owner: User) -> list[Lease]:
    """Three, claimed together."""
    for _ in range(3):
        queue_rows.queued(edition, owner)
    return lifecycle.claim(lease_s=LEASE_S, wall_s=WALL_S, limit=3)


@pytest.mark.parametrize("fault", [OperationalError, InterfaceError])
def test_database_that_is_away_ends_no_run(
    leases: list[Lease], monkeypatch: pytest.MonkeyPatch, fault: type[Exception]
) -> None:
    def away(*_: object, **__: object) -> bool:
        raise fault("the server closed the connection unexpectedly")

    heartbeat = Heartbeat(leases[0], waiting=deque(), lease_s=LEASE_S, wall_s=WALL_S)
    monkeypatch.setattr(lifecycle, "heartbeat", away)
    monkeypatch.setattr(worker.connection, "close", lambda: None)
    assert heartbeat.beat()


def test_run_ends_by_its_own_clock_where_the_database_cannot_say_so(leases: list[Lease]) -> None:
    assert not Heartbeat(leases[0], waiting=deque(), lease_s=LEASE_S, wall_s=0.0).beat()


def test_what_waits_behind_a_long_run_is_handed_back(leases: list[Lease]) -> None:
    waiting = deque(leases[1:])
    assert Heartbeat(leases[0], waiting=waiting, lease_s=LEASE_S, wall_s=WALL_S).beat()
    assert not waiting
    assert [queue_rows.row(lease).status for lease in leases] == [
        Status.RUNNING,
        Status.QUEUED,
        Status.QUEUED,
    ]
