"""Workers, zombies and impatient clients at the same moment, each with a connection of its own."""

import random
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TypeVar

import pytest
from django.db import connection

from leaderboard.models import AuditEvent, Edition, Evaluation, Score, Status, Submission, User
from leaderboard.queue import lifecycle
from leaderboard.queue.lifecycle import MAX_INFRASTRUCTURE_STRIKES, Lease, LostRace
from tests import builders
from tests.leaderboard.db.test_races import at_once
from tests.leaderboard.web.maintain import queue_rows
from tests.leaderboard.web.maintain.queue_rows import LEASE_S, SCORED, WALL_S

T = TypeVar("T")

pytestmark = [
    pytest.mark.django_db(transaction=True),
    pytest.mark.skipif(connection.vendor != "postgresql", reason="SQLite has one connection for all"),
]

N_ZOMBIES = 50


def all_at_once(*actions: Callable[[], T]) -> list[T]:
    """Do everything at the same moment; what came of each."""
    return at_once(len(actions), lambda number: actions[number]())


def verdict(lease: Lease, value: float) -> str:
    """The answer to a worker that finalises with this lease."""
    try:
        is_written = lifecycle.finalise(lease, replace(SCORED, scores={("mid", "overall"): value}))
    except LostRace:
        return "discarded"
    return "written" if is_written else "known"


def test_fifty_zombies_are_fenced_each_while_its_successor_writes(edition: Edition, owner: User) -> None:
    verdicts = []
    for number in range(N_ZOMBIES):
        queue_rows.queued(edition, owner)
        zombie = queue_rows.claim()
        queue_rows.expire(zombie)
        queue_rows.release_expired()
        queue_rows.make_due()
        successor = queue_rows.claim()
        assert successor.evaluation_id == zombie.evaluation_id
        both = [partial(verdict, zombie, 1.0), partial(verdict, successor, 2.0)]
        if number % 2:
            both.reverse()
        verdicts.append(sorted(all_at_once(*both)))
        assert verdict(zombie, 1.0) == "discarded"
    assert verdicts == [["discarded", "written"]] * N_ZOMBIES
    assert list(Score.objects.values_list("value", flat=True)) == [2.0] * N_ZOMBIES
    assert AuditEvent.objects.filter(verb="scored").count() == N_ZOMBIES


def test_two_hundred_evaluations_are_claimed_once_each_by_eight_workers(
    edition: Edition, owner: User
) -> None:
    for _ in range(200):
        queue_rows.queued(edition, owner)

    def work() -> list[Lease]:
        mine: list[Lease] = []
        while claimed := lifecycle.claim(lease_s=LEASE_S, wall_s=WALL_S, limit=3):
            mine += claimed
        return mine

    claimed = [lease for mine in all_at_once(*[work] * 8) for lease in mine]
    assert len(claimed) == len({lease.evaluation_id for lease in claimed}) == 200
    assert set(Evaluation.objects.values_list("attempt", flat=True)) == {1}


def test_finalise_against_cancel_ends_in_exactly_one_of_the_two(edition: Edition, owner: User) -> None:
    for _ in range(10):
        evaluation = queue_rows.queued(edition, owner)
        lease = queue_rows.claim()

        def cancel(submission: Submission = evaluation.submission) -> str:
            return "cancelled" if lifecycle.cancel(submission=submission, actor=owner) else "too late"

        outcome = all_at_once(cancel, partial(verdict, lease, 1.0))
        status = queue_rows.row(lease).status
        assert (outcome, status) in [
            (["cancelled", "discarded"], Status.CANCELLED),
            (["too late", "written"], Status.SCORED),
        ]
        assert queue_rows.n_scores(lease) == (status == Status.SCORED)


def test_a_newcomers_first_files_sent_at_once_make_one_team(edition: Edition, db: None) -> None:
    newcomer = User.objects.create(email="new@example.org", name="Newcomers")
    files = [builders.predictions(edition, factor=1.1 + number / 100) for number in range(4)]
    sent = all_at_once(*[partial(builders.submit, newcomer, data) for data in files])
    assert len({submission.pk for submission in sent}) == 4
    assert len({submission.method.team_id for submission in sent}) == 1
    assert len({submission.method_id for submission in sent}) == 1


def test_random_workers_at_once_decide_everything_exactly_once(edition: Edition, owner: User) -> None:
    """A small chaos in threads: leases run out under their holders while everybody claims and decides."""
    for _ in range(60):
        queue_rows.queued(edition, owner)

    def work(seed: int) -> int:
        rng = random.Random(seed)
        n_written = 0
        while Evaluation.objects.filter(status__in=[Status.QUEUED, Status.RUNNING]).exists():
            lifecycle.release_expired(rng=rng)
            queue_rows.make_due()
            for lease in lifecycle.claim(lease_s=LEASE_S, wall_s=WALL_S):
                # Now and then, and never so often that the strikes give up on an evaluation.
                if lease.attempt < MAX_INFRASTRUCTURE_STRIKES and rng.random() < 0.3:
                    queue_rows.expire(lease)
                    lifecycle.release_expired(rng=rng)
                n_written += verdict(lease, 3.0) == "written"
        return n_written

    assert sum(all_at_once(*[partial(work, seed) for seed in range(4)])) == 60
    assert Score.objects.count() == AuditEvent.objects.filter(verb="scored").count() == 60
    assert set(Evaluation.objects.values_list("status", flat=True)) == {Status.SCORED}
