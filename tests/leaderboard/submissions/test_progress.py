"""`progress_of`: the position in the queue, and whose fault it was."""

import random
from datetime import UTC, datetime

import pytest
from django.utils import timezone

from leaderboard.models import Edition, Evaluation, Status, Submission, User
from leaderboard.queue import lifecycle
from leaderboard.queue.lifecycle import Strike
from leaderboard.submissions.progress import Progress, progress_of
from tests.leaderboard.web.maintain import queue_rows

NOW = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)
RNG = random.Random(0)


def progress(evaluation: Evaluation) -> Progress:
    return progress_of(Evaluation.objects.get(pk=evaluation.pk).submission)


def test_position_counts_those_that_are_claimed_before(edition: Edition, owner: User) -> None:
    rescored = queue_rows.queued(edition, owner, priority=Evaluation.PRIORITY_RESCORE)
    rows = [queue_rows.queued(edition, owner) for _ in range(4)]
    assert [progress(row).n_ahead for row in rows] == [0, 1, 2, 3]
    assert progress(rescored).n_ahead == 4, "live submissions go before re-scoring"
    queue_rows.claim()
    assert [progress(row).n_ahead for row in rows] == [0, 0, 1, 2]


@pytest.mark.parametrize("seed", range(8))
def test_the_number_ahead_is_the_order_in_which_files_are_taken(
    edition: Edition, owner: User, stranger: User, seed: int
) -> None:
    rng = random.Random(seed)
    for _ in range(8):
        priority = rng.choice([Evaluation.PRIORITY_LIVE, Evaluation.PRIORITY_RESCORE])
        row = queue_rows.queued(edition, rng.choice([owner, stranger]), priority=priority)
        strikes = {"n_poison_strikes": rng.randrange(3), "n_infrastructure_strikes": rng.randrange(3)}
        Evaluation.objects.filter(pk=row.pk).update(**strikes)
    if seed % 2:
        queue_rows.claim()  # the other files of its team come later among equals
    waiting = Evaluation.objects.filter(status=Status.QUEUED)
    ahead = {row.pk: progress(row).n_ahead for row in waiting}
    n_waiting = len(ahead)
    taken = []
    for _ in range(n_waiting):
        lease = queue_rows.claim()
        taken.append(lease.evaluation_id)
        lifecycle.finalise(lease, queue_rows.SCORED)
    assert [ahead[pk] for pk in taken] == list(range(n_waiting))


def test_one_that_waits_for_another_try_comes_after_all_that_is_due(edition: Edition, owner: User) -> None:
    struck = queue_rows.queued(edition, owner)
    lifecycle.fail_attempt(queue_rows.claim(), strike=Strike.INFRASTRUCTURE, reason="disk", rng=RNG)
    queue_rows.queued(edition, owner, priority=Evaluation.PRIORITY_RESCORE)
    assert progress(struck).n_ahead == 1
    queue_rows.make_due()
    assert progress(struck).n_ahead == 0


def test_one_that_waits_for_another_try_is_in_nobodys_way(edition: Edition, owner: User) -> None:
    queue_rows.queued(edition, owner)
    second = queue_rows.queued(edition, owner)
    assert progress(second).n_ahead == 1
    lifecycle.fail_attempt(queue_rows.claim(), strike=Strike.INFRASTRUCTURE, reason="disk", rng=RNG)
    assert progress(second).n_ahead == 0


def test_decided_submission_has_no_position_any_more(edition: Edition, owner: User) -> None:
    row = queue_rows.queued(edition, owner)
    lifecycle.finalise(queue_rows.claim(), queue_rows.SCORED)
    done = progress(row)
    assert (done.n_ahead, done.is_late, done.is_final) == (None, False, True)


# --- whose fault it was ---------------------------------------------------------------------------------


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


# --- of two editions -------------------------------------------------------------------------------------


def test_a_file_keeps_its_result_in_the_last_published_edition_and_not_in_one_in_preparation(
    entries: list[Submission], rescored: Edition
) -> None:
    rejected = Evaluation.objects.get(submission=entries[0], edition__number=1)
    Evaluation.objects.filter(pk=rejected.pk).update(status=Status.REJECTED)
    rejected.refresh_from_db()
    assert rejected.kept_in is None
    Edition.objects.filter(pk=rescored.pk).update(published_at=timezone.now())
    rejected = Evaluation.objects.get(pk=rejected.pk)
    assert rejected.kept_in == 2
    assert Evaluation.objects.get(submission=entries[1], edition__number=1).kept_in is None
