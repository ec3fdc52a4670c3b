"""`leaderboard.queue.lifecycle`: what happens to a run that came to nothing."""

import random
from datetime import timedelta

import pytest
from django.db.models.functions import Now
from pytest_django import Settings

from leaderboard.db import clock
from leaderboard.models import AuditEvent, Edition, Evaluation, Status, User
from leaderboard.queue import lifecycle
from leaderboard.queue.lifecycle import MAX_INFRASTRUCTURE_STRIKES, MAX_POISON_STRIKES, Lease, Strike
from tests.leaderboard.web.maintain import queue_rows
from tests.leaderboard.web.maintain.queue_rows import LEASE_S, WALL_S

# --- strikes ---------------------------------------------------------------------------------------------


def test_given_back_evaluation_waits_out_a_growing_backoff(
    edition: Edition, owner: User, settings: Settings
) -> None:
    settings.BACKOFF_S = 4.0
    queue_rows.queued(edition, owner)
    for n_strikes in (1, 2, 3):
        lease = queue_rows.claim()
        Evaluation.objects.update(started_at=Now())
        started_at = queue_rows.row(lease).started_at
        assert queue_rows.give_back(lease) == Status.QUEUED
        row = queue_rows.row(lease)
        assert row.n_infrastructure_strikes == n_strikes
        assert started_at is not None
        assert row.due_at - started_at >= timedelta(seconds=4.0 * 2 ** (n_strikes - 1) / 2)
        assert lifecycle.claim(lease_s=LEASE_S, wall_s=WALL_S) == []
        queue_rows.make_due()


@pytest.mark.parametrize(
    ("strike", "limit"),
    [(Strike.POISON, MAX_POISON_STRIKES), (Strike.INFRASTRUCTURE, MAX_INFRASTRUCTURE_STRIKES)],
)
def test_exhausted_strikes_are_a_system_error_without_scores(
    edition: Edition, owner: User, strike: Strike, limit: int
) -> None:
    queue_rows.queued(edition, owner)
    left = []
    for _ in range(limit):
        queue_rows.make_due()
        lease = queue_rows.claim()
        left.append(queue_rows.give_back(lease, strike))
    assert left == [Status.QUEUED] * (limit - 1) + [Status.SYSTEM_ERROR]
    row = queue_rows.row(lease)
    assert row.finished_at is not None
    assert row.last_error == "the disk failed"
    assert AuditEvent.objects.filter(verb="system_error", noun_id=row.pk).count() == 1
    assert lifecycle.claim(lease_s=LEASE_S, wall_s=WALL_S) == []


def test_a_run_that_is_the_last_leaves_a_system_error_until_a_maintainer_retries_it(
    edition: Edition, owner: User, maintainer: User
) -> None:
    evaluation = queue_rows.queued(edition, owner)
    lease = queue_rows.claim()
    failure = {"reason": "reading the file took more than 4 s of processor time", "rng": random.Random(0)}
    assert lifecycle.fail_attempt(lease, strike=Strike.POISON, is_last=True, **failure) == Status.SYSTEM_ERROR
    row = queue_rows.row(lease)
    assert (row.attempt, row.n_poison_strikes, row.last_error) == (1, 1, failure["reason"])
    assert row.is_file_suspect
    assert AuditEvent.objects.filter(verb="system_error", noun_id=row.pk).count() == 1
    lifecycle.retry(evaluation=evaluation, actor=maintainer)
    assert queue_rows.claim().attempt == 2


# --- the sweep -------------------------------------------------------------------------------------------


def test_expired_lease_is_taken_back_once_as_an_infrastructure_strike(lease: Lease) -> None:
    queue_rows.expire(lease)
    assert (queue_rows.release_expired(), queue_rows.release_expired()) == (1, 0)
    row = queue_rows.row(lease)
    assert (row.status, row.n_infrastructure_strikes, row.n_poison_strikes) == (Status.QUEUED, 1, 0)
    assert row.last_error == "the worker stopped answering"


def test_a_run_that_lasts_until_its_deadline_is_poison(lease: Lease) -> None:
    queue_rows.expire(lease, overran=True)
    assert queue_rows.release_expired() == 1
    row = queue_rows.row(lease)
    assert (row.n_infrastructure_strikes, row.n_poison_strikes) == (0, 1)
    assert row.last_error == "the run reached its time limit"


def test_a_sweep_that_comes_after_the_deadline_does_not_blame_the_file_for_a_dead_worker(
    lease: Lease,
) -> None:
    Evaluation.objects.update(
        leased_until=Now() - timedelta(seconds=400), deadline_at=Now() - timedelta(seconds=160)
    )
    assert queue_rows.release_expired() == 1
    assert queue_rows.row(lease).n_poison_strikes == 0


def test_first_retry_comes_within_the_backoff_and_no_later_one_after_more_than_a_minute(
    edition: Edition, owner: User, settings: Settings
) -> None:
    settings.BACKOFF_S = 50.0
    queue_rows.queued(edition, owner)
    for longest_s in (50.0, 60.0, 60.0):
        lease = queue_rows.claim()
        assert queue_rows.give_back(lease) == Status.QUEUED
        wait_s = (queue_rows.row(lease).due_at - clock.database_now()).total_seconds()
        assert longest_s / 2 - 5 < wait_s <= longest_s
        queue_rows.make_due()
