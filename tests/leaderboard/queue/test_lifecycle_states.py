"""The life of an evaluation under random steps: `lifecycle.py` against a model that fits on a page.

Hypothesis plays workers, zombies, sweeps, cancelling teams and retrying maintainers in any order and compares
the database with the model after every step.
"""

import random
import uuid
from dataclasses import dataclass, field, replace
from datetime import timedelta
from typing import Any

import pytest
from django.db import connection, transaction
from django.db.models.functions import Now
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    Bundle,
    RuleBasedStateMachine,
    consumes,
    invariant,
    multiple,
    precondition,
    rule,
    run_state_machine_as_test,
)

from leaderboard.models import AuditEvent, Edition, Evaluation, Score, Status, User
from leaderboard.queue import lifecycle
from leaderboard.queue.lifecycle import (
    MAX_INFRASTRUCTURE_STRIKES,
    MAX_POISON_STRIKES,
    Lease,
    LostRace,
    RunResult,
    Strike,
)
from tests.leaderboard.web.maintain import queue_rows
from tests.leaderboard.web.maintain.queue_rows import LEASE_S, REJECTED, SCORED, WALL_S

pytestmark = pytest.mark.slow

LIMITS = {Strike.POISON: MAX_POISON_STRIKES, Strike.INFRASTRUCTURE: MAX_INFRASTRUCTURE_STRIKES}
OUTCOMES = st.sampled_from([SCORED, REJECTED])


@dataclass
class Expected:
    """The model's state of one evaluation."""

    status: Status = Status.QUEUED
    attempt: int = 0
    lease: Lease | None = None
    overran: bool = False
    is_expired: bool = False
    decided_by: Lease | None = None
    n_results: int = 0
    strikes: dict[Strike, int] = field(default_factory=lambda: dict.fromkeys(Strike, 0))

    def holds(self, lease: Lease) -> bool:
        """Say if this lease may still decide the evaluation."""
        return self.status == Status.RUNNING and self.lease == lease

    def struck(self, strike: Strike, *, is_last: bool = False) -> Status:
        """Count a strike; the state that follows."""
        self.strikes[strike] += 1
        is_over = is_last or self.strikes[strike] >= LIMITS[strike]
        self.status = Status.SYSTEM_ERROR if is_over else Status.QUEUED
        return self.status


class Life(RuleBasedStateMachine):
    """Everything that can happen to the evaluations of one edition, in any order."""

    edition: Edition
    team_member: User
    maintainer: User

    leases = Bundle("leases")
    evaluations = Bundle("evaluations")

    def __init__(self) -> None:
        super().__init__()
        self.model: dict[uuid.UUID, Expected] = {}
        self.attempts: dict[uuid.UUID, int] = {}
        self.finals: dict[uuid.UUID, Evaluation] = {}
        self.savepoint = transaction.savepoint()

    def teardown(self) -> None:
        """The next example starts from an empty queue."""
        transaction.savepoint_rollback(self.savepoint)

    # --- steps -------------------------------------------------------------------------------------------

    @rule(target=evaluations)
    def submit(self) -> uuid.UUID:
        evaluation = queue_rows.queued(self.edition, self.team_member)
        # One second apart, so that the order of the queue does not hang on the clock's resolution.
        queued_at = self.edition.opened_at + timedelta(seconds=len(self.model))
        Evaluation.objects.filter(pk=evaluation.pk).update(queued_at=queued_at)
        self.model[evaluation.pk] = Expected()
        return evaluation.pk

    @rule(target=leases, limit=st.integers(1, 3))
    def claim(self, limit: int) -> Any:
        queue_rows.make_due()
        waiting = {pk for pk, expected in self.model.items() if expected.status == Status.QUEUED}
        leases = lifecycle.claim(lease_s=LEASE_S, wall_s=WALL_S, limit=limit)
        assert {lease.evaluation_id for lease in leases} <= waiting
        assert len(leases) == min(limit, len(waiting))
        for lease in leases:
            expected = self.model[lease.evaluation_id]
            expected.status, expected.lease, expected.attempt = Status.RUNNING, lease, expected.attempt + 1
            expected.is_expired = expected.overran = False
            assert lease.attempt == expected.attempt
        return multiple(*leases)

    @rule(lease=leases)
    def heartbeat(self, lease: Lease) -> None:
        expected = self.model[lease.evaluation_id]
        may_continue = expected.holds(lease) and not expected.overran
        assert lifecycle.heartbeat(lease, lease_s=LEASE_S) == may_continue
        if may_continue:
            expected.is_expired = False

    @rule(lease=leases, outcome=OUTCOMES)
    def finalise(self, lease: Lease, outcome: RunResult) -> None:
        expected = self.model[lease.evaluation_id]
        if expected.holds(lease):
            assert lifecycle.finalise(lease, outcome)
            expected.status, expected.decided_by = outcome.status, lease
            expected.n_results += 1
        elif expected.decided_by == lease and expected.status == outcome.status:
            assert not lifecycle.finalise(lease, outcome)
        else:
            with pytest.raises(LostRace):
                lifecycle.finalise(lease, outcome)

    @rule(
        lease=leases,
        outcome=OUTCOMES,
        forged=st.one_of(
            st.builds(lambda by: {"attempt": by}, st.integers(1, 3)),
            st.builds(lambda token: {"token": token}, st.uuids(version=4)),
        ),
    )
    def finalise_with_half_a_lease(self, lease: Lease, outcome: RunResult, forged: dict[str, object]) -> None:
        changes = dict(forged)
        if "attempt" in changes:
            changes["attempt"] = lease.attempt + forged["attempt"]  # type: ignore[operator]  # an int, see above
        with pytest.raises(LostRace):
            lifecycle.finalise(replace(lease, **changes), outcome)  # type: ignore[arg-type]  # either field

    @rule(lease=leases, strike=st.sampled_from(Strike), is_last=st.booleans())
    def give_back(self, lease: Lease, strike: Strike, is_last: bool) -> None:
        expected = self.model[lease.evaluation_id]
        failure: dict[str, Any] = {"strike": strike, "reason": "x", "rng": random.Random(0)}
        if expected.holds(lease):
            status = lifecycle.fail_attempt(lease, is_last=is_last, **failure)
            assert status == expected.struck(strike, is_last=is_last)
        else:
            with pytest.raises(LostRace):
                lifecycle.fail_attempt(lease, is_last=is_last, **failure)

    @rule(some=st.lists(leases, max_size=4, unique_by=lambda lease: lease.evaluation_id))
    def hand_back(self, some: list[Lease]) -> None:
        valid = [lease for lease in some if self.model[lease.evaluation_id].holds(lease)]
        assert lifecycle.release(some) == len(valid)
        for lease in valid:
            self.model[lease.evaluation_id].status = Status.QUEUED

    @rule(lease=leases, overran=st.booleans())
    def time_passes_beyond_the_lease(self, lease: Lease, overran: bool) -> None:
        expected = self.model[lease.evaluation_id]
        if expected.holds(lease) and not expected.is_expired:
            queue_rows.expire(lease, overran=overran)
            expected.is_expired, expected.overran = True, overran

    @rule()
    def sweep(self) -> None:
        expired = [e for e in self.model.values() if e.status == Status.RUNNING and e.is_expired]
        assert queue_rows.release_expired() == len(expired)
        for expected in expired:
            expected.struck(Strike.POISON if expected.overran else Strike.INFRASTRUCTURE)

    @rule(evaluation_id=evaluations)
    def cancel(self, evaluation_id: uuid.UUID) -> None:
        expected = self.model[evaluation_id]
        submission = Evaluation.objects.get(pk=evaluation_id).submission
        is_open = expected.status in (Status.QUEUED, Status.RUNNING)
        assert lifecycle.cancel(submission=submission, actor=self.team_member) == int(is_open)
        if is_open:
            expected.status = Status.CANCELLED

    @rule(evaluation_id=evaluations)
    def retry(self, evaluation_id: uuid.UUID) -> None:
        expected = self.model[evaluation_id]
        evaluation = Evaluation.objects.get(pk=evaluation_id)
        if expected.status == Status.SYSTEM_ERROR:
            lifecycle.retry(evaluation=evaluation, actor=self.maintainer)
            expected.status, expected.strikes = Status.QUEUED, dict.fromkeys(Strike, 0)
            self.finals.pop(evaluation_id, None)
        else:
            with pytest.raises(LostRace):
                lifecycle.retry(evaluation=evaluation, actor=self.maintainer)

    @rule(evaluation_id=evaluations)
    def queue_again(self, evaluation_id: uuid.UUID) -> None:
        evaluation = Evaluation.objects.get(pk=evaluation_id)
        again = lifecycle.enqueue(submission=evaluation.submission, edition=self.edition)
        assert again.pk == evaluation_id

    @rule(lease=consumes(leases))
    def worker_vanishes(self, lease: Lease) -> None:
        """Nobody will ever use this lease again."""

    @precondition(lambda self: self.model)
    @rule(strike=st.sampled_from(Strike))
    def everything_goes_wrong_until_it_is_given_up(self, strike: Strike) -> None:
        pk, expected = next(iter(self.model.items()))
        while expected.status == Status.QUEUED:
            queue_rows.make_due()
            # First in line, whatever its strikes.
            others = Evaluation.objects.filter(status=Status.QUEUED).exclude(pk=pk)
            others.update(due_at=Now() + timedelta(days=1))
            lease = queue_rows.claim()
            assert lease.evaluation_id == pk
            expected.attempt += 1
            expected.lease = lease
            status = lifecycle.fail_attempt(lease, strike=strike, reason="x", rng=random.Random(0))
            assert status == expected.struck(strike)

    # --- what always holds -------------------------------------------------------------------------------

    @invariant()
    def the_database_says_what_the_model_says(self) -> None:
        rows = {row.pk: row for row in Evaluation.objects.all()}
        assert rows.keys() == self.model.keys()
        for pk, row in rows.items():
            expected = self.model[pk]
            assert (row.status, row.attempt) == (expected.status, expected.attempt)
            assert row.n_poison_strikes == expected.strikes[Strike.POISON] <= MAX_POISON_STRIKES
            n_infrastructure = expected.strikes[Strike.INFRASTRUCTURE]
            assert row.n_infrastructure_strikes == n_infrastructure <= MAX_INFRASTRUCTURE_STRIKES

    @invariant()
    def there_is_at_most_one_final_result(self) -> None:
        n_results = AuditEvent.objects.filter(noun="Evaluation", verb__in=["scored", "rejected"]).count()
        assert n_results == sum(expected.n_results for expected in self.model.values())
        assert all(expected.n_results <= 1 for expected in self.model.values())

    @invariant()
    def scores_exist_exactly_where_the_status_is_scored(self) -> None:
        scored = {pk for pk, expected in self.model.items() if expected.status == Status.SCORED}
        assert set(Score.objects.values_list("evaluation_id", flat=True)) == scored

    @invariant()
    def what_runs_has_a_lease_that_ends_by_its_deadline(self) -> None:
        for row in Evaluation.objects.filter(status=Status.RUNNING):
            expected = self.model[row.pk]
            assert expected.lease is not None
            assert row.lease_token == expected.lease.token
            assert row.leased_until is not None
            assert row.deadline_at is not None
            assert row.leased_until <= row.deadline_at

    @invariant()
    def an_attempt_never_decreases_and_nothing_final_changes(self) -> None:
        for row in Evaluation.objects.all():
            assert row.attempt >= self.attempts.get(row.pk, 0)
            self.attempts[row.pk] = row.attempt
            before = self.finals.get(row.pk)
            if before is not None:
                names = [column.attname for column in row._meta.concrete_fields]
                assert all(getattr(row, name) == getattr(before, name) for name in names)
            elif row.is_final:
                assert row.finished_at is not None
                self.finals[row.pk] = row


def test_thousands_of_random_steps_break_no_promise(edition: Edition, owner: User, maintainer: User) -> None:
    Life.edition, Life.team_member, Life.maintainer = edition, owner, maintainer
    run_state_machine_as_test(
        Life,
        settings=settings(
            # The steps are the same on both databases: on the other one they look for faults of its SQL.
            max_examples=50 if connection.vendor == "sqlite" else 20,
            stateful_step_count=60,
            deadline=None,
            suppress_health_check=list(HealthCheck),
            database=None,
        ),
    )
