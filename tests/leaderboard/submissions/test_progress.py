"""`submissions.progress`: the place in the queue, an honest estimate, and whose fault it was."""

import random
from datetime import UTC, datetime, timedelta

import pytest
from django.db.models import F
from django.utils import timezone

from leaderboard.models import Edition, Evaluation, Status, SweepBeat, User
from leaderboard.ops import health
from leaderboard.scoring import lifecycle
from leaderboard.scoring.lifecycle import Strike
from leaderboard.submissions import estimates, submissions
from leaderboard.submissions.estimates import Evidence, RecentRun
from leaderboard.submissions.submissions import Progress
from tests.leaderboard.web.maintain import queue_rows

NOW = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)
RNG = random.Random(0)


def run(*, started: float, finished: float) -> RecentRun:
    """A run by seconds before now."""
    return RecentRun(*(NOW - timedelta(seconds=seconds) for seconds in (started, finished)))


def alone(n: int, *, took_s: float) -> list[RecentRun]:
    """Runs that met nobody: each begins long after the one before has ended."""
    ends = [100.0 * (i + 1) for i in range(n)]
    return [run(started=end + took_s, finished=end) for end in ends]


def side_by_side(n_rounds: int, *, n_workers: int, took_s: float) -> list[RecentRun]:
    """Runs in rounds, as many at once as there are workers."""
    begin = n_rounds * took_s
    return [
        run(started=begin - i * took_s, finished=begin - (i + 1) * took_s)
        for i in range(n_rounds)
        for _ in range(n_workers)
    ]


def evidence(runs: list[RecentRun], *, n_running: int = 0, is_alive: bool = True) -> Evidence:
    return Evidence(now=NOW, runs=runs, n_running=n_running, is_alive=is_alive)


@pytest.mark.parametrize(
    ("runs", "n_running", "n_ahead", "expected_s"),
    [
        # A free worker: only one's own run.
        (alone(5, took_s=2.0), 0, 0, 2.0),
        # One worker: those before it, one after the other.
        (alone(5, took_s=2.0), 1, 0, 4.0),
        (alone(5, took_s=2.0), 0, 3, 8.0),
        (alone(5, took_s=2.0), 1, 3, 10.0),
        # Four workers seen at once: four times as quick, and nothing to wait for while one of them is free.
        (side_by_side(5, n_workers=4, took_s=2.0), 3, 0, 2.0),
        (side_by_side(5, n_workers=4, took_s=2.0), 4, 0, 2.5),
        (side_by_side(5, n_workers=4, took_s=2.0), 4, 39, 22.0),
        # More run now than the last runs showed.
        (alone(5, took_s=2.0), 2, 1, 4.0),
    ],
)
def test_estimate_follows_from_what_the_last_runs_show(
    runs: list[RecentRun], n_running: int, n_ahead: int, expected_s: float
) -> None:
    found_s = estimates.wait_s(evidence(runs, n_running=n_running), n_ahead=n_ahead)
    assert found_s == pytest.approx(expected_s)


def test_without_a_run_nothing_is_claimed() -> None:
    assert estimates.wait_s(evidence([]), n_ahead=0) is None
    assert estimates.left_s(evidence([]), elapsed_s=1.0) is None


def test_without_a_sign_of_life_nothing_is_claimed() -> None:
    assert estimates.wait_s(evidence(alone(50, took_s=2.0), is_alive=False), n_ahead=0) is None


def test_next_try_is_not_promised_before_it_is_due() -> None:
    assert estimates.wait_s(evidence(alone(5, took_s=2.0)), n_ahead=0, due_in_s=30.0) == pytest.approx(32.0)


@pytest.mark.parametrize(
    ("elapsed_s", "left_s"), [(0.0, 4.0), (1.5, 2.5), (5.0, 1.0), (6.0, None), (60.0, None)]
)
def test_rest_of_a_run_is_what_longer_runs_took_beyond(elapsed_s: float, left_s: float | None) -> None:
    runs = [run(started=took_s, finished=0) for took_s in (2.0, 4.0, 6.0)]
    assert estimates.left_s(evidence(runs), elapsed_s=elapsed_s) == (left_s and pytest.approx(left_s))


# --- with rows ------------------------------------------------------------------------------------------


def progress(evaluation: Evaluation) -> Progress:
    return submissions.progress(Evaluation.objects.get(pk=evaluation.pk).submission)


def decide(edition: Edition, user: User, *, took_s: float, n: int = 1) -> None:
    """Runs that took so long, each alone, the last of them a minute and a half ago."""
    for i in range(n):
        evaluation = queue_rows.queued(edition, user)
        lifecycle.finalise(queue_rows.claim(), queue_rows.SCORED)
        end = F("finished_at") - timedelta(seconds=90 + 1000 * i)
        Evaluation.objects.filter(pk=evaluation.pk).update(
            queued_at=end - timedelta(seconds=took_s),
            started_at=end - timedelta(seconds=took_s),
            finished_at=end,
        )


def test_place_counts_those_that_are_claimed_before(edition: Edition, owner: User) -> None:
    rescored = queue_rows.queued(edition, owner, priority=Evaluation.PRIORITY_RESCORE)
    rows = [queue_rows.queued(edition, owner) for _ in range(4)]
    assert [progress(row).n_ahead for row in rows] == [0, 1, 2, 3]
    assert progress(rescored).n_ahead == 4, "live submissions go before re-scoring"
    queue_rows.claim()
    assert [progress(row).n_ahead for row in rows] == [0, 0, 1, 2]


def test_one_that_waits_for_another_try_is_in_nobodys_way(edition: Edition, owner: User) -> None:
    queue_rows.queued(edition, owner)
    second = queue_rows.queued(edition, owner)
    assert progress(second).n_ahead == 1
    lifecycle.fail_attempt(queue_rows.claim(), strike=Strike.INFRASTRUCTURE, reason="disk", rng=RNG)
    assert progress(second).n_ahead == 0


def test_first_submission_ever_gets_no_estimate(edition: Edition, owner: User) -> None:
    health.record_sweep()
    waiting = progress(queue_rows.queued(edition, owner))
    assert (waiting.n_ahead, waiting.estimate_s) == (0, None)


def test_estimate_is_there_while_somebody_works_and_gone_when_nobody_does(
    edition: Edition, owner: User
) -> None:
    decide(edition, owner, took_s=2.0, n=5)
    row = queue_rows.queued(edition, owner)
    assert progress(row).estimate_s is None, "no sweep ever, and the last run is a while ago"
    health.record_sweep()
    assert progress(row).estimate_s == pytest.approx(2.0, abs=0.5)
    SweepBeat.objects.update(swept_at=F("swept_at") - timedelta(seconds=61))
    assert progress(row).estimate_s is None


def test_estimate_grows_with_the_queue(edition: Edition, owner: User) -> None:
    decide(edition, owner, took_s=2.0, n=5)
    health.record_sweep()
    rows = [queue_rows.queued(edition, owner) for _ in range(4)]
    assert [progress(row).estimate_s for row in rows] == pytest.approx([2.0, 4.0, 6.0, 8.0], abs=0.5)


def test_worker_that_vanished_is_not_counted_as_working(edition: Edition, owner: User) -> None:
    decide(edition, owner, took_s=2.0, n=5)
    queue_rows.queued(edition, owner)
    waiting = queue_rows.queued(edition, owner)
    lease = queue_rows.claim()
    assert progress(waiting).estimate_s == pytest.approx(4.0, abs=0.5), "a held lease is a sign of life"
    queue_rows.expire(lease)
    assert progress(waiting).estimate_s is None


def test_running_submission_says_how_long_it_may_still_take(edition: Edition, owner: User) -> None:
    decide(edition, owner, took_s=20.0, n=3)
    row = queue_rows.queued(edition, owner)
    queue_rows.claim()
    Evaluation.objects.filter(pk=row.pk).update(started_at=F("started_at") - timedelta(seconds=5))
    running = progress(row)
    assert running.n_ahead == 0
    assert running.estimate_s == pytest.approx(15.0, abs=2)


def test_only_the_last_runs_count(edition: Edition, owner: User, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(estimates, "N_RUNS", 3)
    decide(edition, owner, took_s=2.0, n=3)
    slow = queue_rows.queued(edition, owner)
    lifecycle.finalise(queue_rows.claim(), queue_rows.SCORED)
    long_ago = timezone.now() - timedelta(days=30)
    Evaluation.objects.filter(pk=slow.pk).update(
        started_at=long_ago - timedelta(hours=1), finished_at=long_ago
    )
    health.record_sweep()
    assert progress(queue_rows.queued(edition, owner)).estimate_s == pytest.approx(2.0, abs=0.5)


def test_decided_submission_has_no_place_any_more(edition: Edition, owner: User) -> None:
    row = queue_rows.queued(edition, owner)
    lifecycle.finalise(queue_rows.claim(), queue_rows.SCORED)
    done = progress(row)
    assert (done.n_ahead, done.estimate_s, done.is_final) == (None, None, True)


# --- whose fault it was ---------------------------------------------------------------------------------


def test_nothing_needs_saying_while_all_goes_well(edition: Edition, owner: User) -> None:
    row = queue_rows.queued(edition, owner)
    said = [progress(row).sentence]
    lease = queue_rows.claim()
    said.append(progress(row).sentence)
    lifecycle.finalise(lease, queue_rows.SCORED)
    said.append(progress(row).sentence)
    assert said == ["", "", ""]


def test_rejected_is_the_files_fault(edition: Edition, owner: User) -> None:
    row = queue_rows.queued(edition, owner)
    lifecycle.finalise(queue_rows.claim(), queue_rows.REJECTED)
    rejected = progress(row)
    assert rejected.sentence == "The file is at fault: it has 1 problem, so it was not scored."
    assert not rejected.fault_is_ours


@pytest.mark.parametrize(
    ("strike", "n_tries"),
    [
        (Strike.POISON, lifecycle.MAX_POISON_STRIKES),
        (Strike.INFRASTRUCTURE, lifecycle.MAX_INFRASTRUCTURE_STRIKES),
    ],
)
def test_system_error_is_our_fault(edition: Edition, owner: User, strike: Strike, n_tries: int) -> None:
    row = queue_rows.queued(edition, owner)
    for _ in range(n_tries):
        queue_rows.make_due()
        lifecycle.fail_attempt(queue_rows.claim(), strike=strike, reason="secret detail", rng=RNG)
    failed = progress(row)
    assert failed.state == Status.SYSTEM_ERROR
    assert failed.sentence.startswith(
        f"Scoring failed {n_tries} times because of a system error; the file is not at fault."
    )
    assert "secret detail" not in failed.sentence
    assert failed.fault_is_ours


def test_cancelled_was_its_teams_wish(edition: Edition, owner: User) -> None:
    row = queue_rows.queued(edition, owner)
    lifecycle.cancel(submission=row.submission, actor=owner)
    assert progress(row).sentence == "The team cancelled the submission before it was scored."


def test_try_that_failed_says_nothing_about_the_file(edition: Edition, owner: User) -> None:
    row = queue_rows.queued(edition, owner)
    lifecycle.fail_attempt(queue_rows.claim(), strike=Strike.INFRASTRUCTURE, reason="disk", rng=RNG)
    again = progress(row)
    assert again.sentence.startswith("One try ended without a result; the file may be fine.")
    assert not again.fault_is_ours
