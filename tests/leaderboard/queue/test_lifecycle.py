"""`leaderboard.queue.lifecycle`: every verb, one step at a time."""

from dataclasses import replace
from datetime import timedelta

import pytest
from django.db import IntegrityError, transaction
from django.db.models.functions import Now
from pytest_django import DjangoCaptureOnCommitCallbacks

from leaderboard.models import AuditEvent, Edition, Evaluation, Method, Score, Status, Submission, User
from leaderboard.ops import broker
from leaderboard.people import teams
from leaderboard.queue import lifecycle
from leaderboard.queue.lifecycle import MAX_POISON_STRIKES, Lease, LostRace, RunResult, Strike
from tests.leaderboard.web.maintain import queue_rows
from tests.leaderboard.web.maintain.queue_rows import LEASE_S, REJECTED, SCORED, WALL_S

# --- enqueue ---------------------------------------------------------------------------------------------


def test_the_database_refuses_a_second_evaluation_of_a_submission_in_an_edition(
    edition: Edition, owner: User
) -> None:
    first = queue_rows.queued(edition, owner)
    with pytest.raises(IntegrityError), transaction.atomic():
        Evaluation.objects.create(submission=first.submission, edition=edition)


def test_nudge_is_sent_after_the_commit_and_its_failure_is_nobodys_problem(
    edition: Edition,
    owner: User,
    monkeypatch: pytest.MonkeyPatch,
    django_capture_on_commit_callbacks: DjangoCaptureOnCommitCallbacks,
) -> None:
    sent: list[bool] = []

    def broken_nudge() -> None:
        sent.append(True)
        raise RuntimeError("the broker's client has a fault of its own")

    monkeypatch.setattr(broker, "nudge", broken_nudge)
    with django_capture_on_commit_callbacks(execute=True):
        queue_rows.queued(edition, owner)
        assert not sent
    assert sent == [True]


# --- claim -----------------------------------------------------------------------------------------------


def test_claim_gives_attempt_token_lease_and_deadline(edition: Edition, owner: User) -> None:
    evaluation = queue_rows.queued(edition, owner)
    lease = queue_rows.claim()
    evaluation.refresh_from_db()
    assert (lease.evaluation_id, lease.attempt, evaluation.attempt) == (evaluation.pk, 1, 1)
    assert (evaluation.status, evaluation.lease_token) == (Status.RUNNING, lease.token)
    assert evaluation.started_at is not None
    assert evaluation.leased_until == evaluation.started_at + timedelta(seconds=LEASE_S)
    assert evaluation.deadline_at == evaluation.started_at + timedelta(seconds=WALL_S)


def test_most_urgent_then_oldest_goes_first(edition: Edition, owner: User) -> None:
    rescored = queue_rows.queued(edition, owner, priority=Evaluation.PRIORITY_RESCORE)
    older, newer = queue_rows.queued(edition, owner), queue_rows.queued(edition, owner)
    Evaluation.objects.filter(pk=rescored.pk).update(queued_at=Now() - timedelta(days=2))
    Evaluation.objects.filter(pk=older.pk).update(queued_at=Now() - timedelta(days=1))
    assert list(Evaluation.objects.due()) == [older, newer, rescored]
    assert [queue_rows.claim().evaluation_id for _ in range(3)] == [older.pk, newer.pk, rescored.pk]


def test_a_file_that_stopped_its_reader_goes_behind_all_others(edition: Edition, owner: User) -> None:
    struck, rescored = (
        queue_rows.queued(edition, owner),
        queue_rows.queued(edition, owner, priority=Evaluation.PRIORITY_RESCORE),
    )
    queue_rows.give_back(queue_rows.claim(), Strike.POISON)
    queue_rows.make_due()
    later = queue_rows.queued(edition, owner)
    expected = [later.pk, rescored.pk, struck.pk]
    assert [queue_rows.claim().evaluation_id for _ in range(3)] == expected


def test_a_team_none_of_whose_files_is_being_read_goes_first(
    edition: Edition, owner: User, teammate: User, stranger: User
) -> None:
    first, second = queue_rows.queued(edition, owner), queue_rows.queued(edition, owner)
    of_a_teammate = queue_rows.queued(edition, teammate)
    of_a_stranger = queue_rows.queued(edition, stranger)
    lease = queue_rows.claim()
    assert lease.evaluation_id == first.pk
    assert list(Evaluation.objects.due()) == [of_a_stranger, second, of_a_teammate]
    assert queue_rows.claim().evaluation_id == of_a_stranger.pk
    # Nobody else waits: a reader that is free takes what there is.
    assert queue_rows.claim().evaluation_id == second.pk
    lifecycle.finalise(lease, SCORED)


def test_a_person_who_changes_teams_has_no_second_turn(edition: Edition, owner: User, stranger: User) -> None:
    queue_rows.queued(edition, owner)
    queue_rows.claim()
    elsewhere = queue_rows.queued(edition, owner)
    method = Method.objects.create(team=teams.team_of(user=stranger), name="Elsewhere")
    Submission.objects.filter(pk=elsewhere.submission_id).update(method=method)
    of_a_stranger = queue_rows.queued(edition, stranger)
    assert list(Evaluation.objects.due()) == [of_a_stranger, elsewhere]


def test_rescoring_of_a_teams_files_takes_no_turn_of_its_new_ones(
    edition: Edition, owner: User, stranger: User
) -> None:
    queue_rows.queued(edition, owner, priority=Evaluation.PRIORITY_RESCORE)
    queue_rows.claim()
    older = queue_rows.queued(edition, owner)
    newer = queue_rows.queued(edition, stranger)
    assert list(Evaluation.objects.due()) == [older, newer]


def test_what_is_not_due_yet_is_left_alone(edition: Edition, owner: User) -> None:
    queue_rows.queued(edition, owner)
    Evaluation.objects.update(due_at=Now() + timedelta(seconds=30))
    assert list(Evaluation.objects.due()) == []
    assert lifecycle.claim(lease_s=LEASE_S, wall_s=WALL_S) == []


def test_the_database_refuses_to_run_without_a_lease(edition: Edition, owner: User) -> None:
    queue_rows.queued(edition, owner)
    with pytest.raises(IntegrityError), transaction.atomic():
        Evaluation.objects.update(status=Status.RUNNING)


# --- heartbeat -------------------------------------------------------------------------------------------


def test_heartbeat_renews_the_lease(lease: Lease) -> None:
    Evaluation.objects.update(leased_until=Now())
    before = queue_rows.row(lease).leased_until
    assert before is not None
    assert lifecycle.heartbeat(lease, lease_s=LEASE_S)
    after = queue_rows.row(lease).leased_until
    assert after is not None
    assert after - before >= timedelta(seconds=LEASE_S)


def test_heartbeat_never_renews_beyond_the_deadline(lease: Lease) -> None:
    Evaluation.objects.update(deadline_at=Now() + timedelta(seconds=5))
    assert lifecycle.heartbeat(lease, lease_s=LEASE_S)
    row = queue_rows.row(lease)
    assert row.leased_until == row.deadline_at


def test_heartbeat_after_the_deadline_says_stop(lease: Lease) -> None:
    queue_rows.expire(lease, overran=True)
    assert not lifecycle.heartbeat(lease, lease_s=LEASE_S)


# --- finalise --------------------------------------------------------------------------------------------


def test_scores_report_status_and_audit_are_written_together(lease: Lease) -> None:
    assert lifecycle.finalise(lease, SCORED)
    row = queue_rows.row(lease)
    assert (row.status, row.finished_attempt, row.report) == (Status.SCORED, 1, SCORED.report)
    assert row.finished_at is not None
    assert {(s.metric, s.ttc_range): s.value for s in row.scores.all()} == SCORED.scores
    assert (
        AuditEvent.objects.filter(noun="Evaluation", noun_id=lease.evaluation_id, verb="scored").count() == 1
    )


def test_rejection_keeps_its_problems_and_has_no_scores(lease: Lease) -> None:
    assert lifecycle.finalise(lease, REJECTED)
    row = queue_rows.row(lease)
    assert (row.status, row.problems, row.n_problems) == (Status.REJECTED, list(REJECTED.problems), 1)
    assert queue_rows.n_scores(lease) == 0


def test_a_score_that_cannot_be_kept_leaves_the_evaluation_undecided(lease: Lease) -> None:
    with pytest.raises(IntegrityError), transaction.atomic():
        lifecycle.finalise(lease, replace(SCORED, scores={("mid", "overall"): -1.0}))
    assert queue_rows.row(lease).status == Status.RUNNING
    assert not Score.objects.exists()


@pytest.mark.parametrize("status", [Status.QUEUED, Status.RUNNING, Status.SYSTEM_ERROR, Status.CANCELLED])
def test_a_run_ends_as_scored_or_rejected_only(lease: Lease, status: Status) -> None:
    with pytest.raises(ValueError, match="SCORED or REJECTED"):
        lifecycle.finalise(lease, RunResult(status=status, scores={}))
    assert queue_rows.row(lease).status == Status.RUNNING


# --- people ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("is_running", [False, True])
def test_cancelled_evaluation_is_final_and_its_run_is_discarded(
    edition: Edition, owner: User, is_running: bool
) -> None:
    evaluation = queue_rows.queued(edition, owner)
    lease = queue_rows.claim() if is_running else None
    assert lifecycle.cancel(submission=evaluation.submission, actor=owner) == 1
    assert lifecycle.cancel(submission=evaluation.submission, actor=owner) == 0
    assert AuditEvent.objects.filter(verb="cancelled", actor=owner).count() == 1
    if lease is not None:
        assert not lifecycle.heartbeat(lease, lease_s=LEASE_S)
        with pytest.raises(LostRace):
            lifecycle.finalise(lease, SCORED)
    assert lifecycle.claim(lease_s=LEASE_S, wall_s=WALL_S) == []
    evaluation.refresh_from_db()
    assert evaluation.status == Status.CANCELLED


def test_maintainer_retries_a_system_error_with_a_clean_slate(
    edition: Edition, owner: User, maintainer: User
) -> None:
    evaluation = queue_rows.queued(edition, owner)
    for _ in range(MAX_POISON_STRIKES):
        queue_rows.make_due()
        last = queue_rows.claim()
        queue_rows.give_back(last, Strike.POISON)
    lifecycle.retry(evaluation=evaluation, actor=maintainer, reason="the limit was too tight")
    lease = queue_rows.claim()
    assert lease.attempt == last.attempt + 1
    with pytest.raises(LostRace):
        lifecycle.finalise(last, SCORED)
    assert queue_rows.give_back(lease, Strike.POISON) == Status.QUEUED
    event = AuditEvent.objects.get(verb="retried")
    assert (event.actor, event.details) == (maintainer, {"reason": "the limit was too tight"})


# --- limits, and two of a batch --------------------------------------------------------------------------


def test_a_lease_ends_no_later_than_the_deadline(edition: Edition, owner: User) -> None:
    queue_rows.queued(edition, owner)
    [lease] = lifecycle.claim(lease_s=WALL_S, wall_s=LEASE_S)
    row = queue_rows.row(lease)
    assert row.leased_until == row.deadline_at
    assert row.deadline_at == row.started_at + timedelta(seconds=LEASE_S)


def test_an_evaluation_of_a_batch_is_not_taken_for_another_one_that_is_decided(
    edition: Edition, owner: User
) -> None:
    for _ in range(2):
        queue_rows.queued(edition, owner, priority=Evaluation.PRIORITY_RESCORE)
    first, second = lifecycle.claim(lease_s=LEASE_S, wall_s=WALL_S, in_batches=True)
    assert (first.token, first.attempt) == (second.token, second.attempt)
    assert lifecycle.finalise(first, SCORED)
    assert not lifecycle.finalise(first, SCORED)
    lifecycle.cancel(submission=queue_rows.row(second).submission, actor=owner)
    with pytest.raises(LostRace):
        lifecycle.finalise(second, SCORED)
