"""Quotas: what costs a slot, what gives it back, and when the next one opens."""

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from django.utils import timezone
from hypothesis import given
from hypothesis import strategies as st

from leaderboard.editions import corrections, splits
from leaderboard.errors.refusals import NotMaintainer
from leaderboard.models import (
    AuditEvent,
    Edition,
    Evaluation,
    PublishedResult,
    QuotaOverride,
    Split,
    Status,
    User,
)
from leaderboard.people import teams
from leaderboard.queue import lifecycle
from leaderboard.quotas import usage
from leaderboard.quotas.usage import Quota, QuotaExceeded
from leaderboard.submissions import intake
from tests import builders
from tests.leaderboard.web.maintain import queue_rows

DAY = timedelta(days=1)
HOUR = timedelta(hours=1)
NOW = datetime(2026, 11, 20, 12, 0, tzinfo=UTC)


def limit(split: str = "test", **rules: object) -> None:
    Split.objects.filter(pk=split).update(**{f"quota_{name}": value for name, value in rules.items()})


def send(user: User, data: bytes, *, at: datetime = NOW, **options: Any) -> intake.Submitted:
    return builders.send(user, data, now=at, **options)


def other(edition: Edition, number: int) -> bytes:
    """A valid file that no other number has."""
    return builders.predictions(edition, factor=1 + number / 100)


def bad(number: int) -> bytes:
    return json.dumps({"bad": number}).encode()


def state(user: User, *, at: datetime = NOW, split: str = "test") -> Quota:
    row = Split.objects.get(pk=split)
    return usage.state(team=teams.current_team_of(user=user), user=user, split=row, now=at)


# --- the rules of the benchmark --------------------------------------------------------------------------


def test_the_three_splits_have_their_quotas_from_the_start(db: None) -> None:
    PublishedResult.objects.all().delete()
    Split.objects.all().delete()
    splits.ensure_splits()
    rules_by_split = {
        split.pk: (split.quota_limit, split.quota_window, split.quota_min_gap, split.quota_rejected_limit)
        for split in Split.objects.all()
    }
    assert rules_by_split == {
        "test": (3, 30 * DAY, DAY, 20),
        "val": (50, DAY, timedelta(0), 20),
        "demo": (20, DAY, timedelta(0), 20),
    }


# --- what costs, and until when --------------------------------------------------------------------------


@pytest.mark.slow
def test_one_more_than_the_limit_is_refused_until_the_oldest_leaves_the_window(
    edition: Edition, owner: User
) -> None:
    limit(limit=3, window=30 * DAY)
    for number in range(3):
        send(owner, other(edition, number), at=NOW + number * DAY)
    with pytest.raises(QuotaExceeded) as caught:
        send(owner, other(edition, 3), at=NOW + 3 * DAY)
    opens_at = NOW + 30 * DAY
    assert str(caught.value) == (
        "Your team has used 3 submissions to Test, its quota for 30 days; "
        "the next slot opens at 2026-12-20 12:00 UTC."
    )
    assert (caught.value.quota.left, caught.value.quota.next_slot_at) == (0, opens_at)
    with pytest.raises(QuotaExceeded):
        send(owner, other(edition, 3), at=opens_at - timedelta(microseconds=1))
    assert send(owner, other(edition, 3), at=opens_at).is_new


def test_two_submissions_are_apart_by_the_gap(edition: Edition, owner: User) -> None:
    limit(limit=3, window=30 * DAY, min_gap=DAY)
    send(owner, other(edition, 1), at=NOW + timedelta(seconds=30))
    with pytest.raises(QuotaExceeded) as caught:
        send(owner, other(edition, 2), at=NOW + 23 * HOUR)
    assert str(caught.value) == (
        "Submissions of a team to Test must be at least 24 hours apart; "
        "the next slot opens at 2026-11-21 12:01 UTC."
    )
    assert caught.value.quota.left == 2
    assert send(owner, other(edition, 2), at=NOW + 25 * HOUR).is_new


def test_each_split_has_its_own_quota(edition: Edition, owner: User, tmp_path: Path) -> None:
    builders.import_truth(tmp_path, split="val", seed=1)
    limit(limit=1)
    limit("val", limit=1)
    send(owner, other(edition, 1))
    assert state(owner).left == 0
    assert state(owner, split="val").left == 1


def test_the_same_bytes_again_cost_nothing_and_are_answered_when_nothing_is_left(
    edition: Edition, owner: User, teammate: User
) -> None:
    limit(limit=2)
    first = send(owner, other(edition, 1))
    assert not send(teammate, other(edition, 1)).is_new
    assert state(owner).used == 1
    send(owner, other(edition, 2))
    again = send(teammate, other(edition, 1))
    assert (again.submission, again.is_new) == (first.submission, False)


def test_a_scored_submission_costs_its_slot_even_if_it_is_withdrawn(edition: Edition, owner: User) -> None:
    limit(limit=1)
    submission = send(owner, other(edition, 1)).submission
    builders.score_all()
    intake.withdraw(submission=submission, actor=owner, now=NOW)
    assert state(owner).left == 0


# --- what is given back ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_cancelling_gives_no_end_of_files_that_are_kept(edition: Edition, owner: User) -> None:
    limit(limit=1, rejected_limit=3)
    for number in range(3):
        submission = send(owner, other(edition, number)).submission
        intake.withdraw(submission=submission, actor=owner, now=NOW)
    with pytest.raises(QuotaExceeded, match="reached its limit for Test: within 24 hours, 3 files"):
        send(owner, other(edition, 3))
    assert (state(owner).left, state(owner).n_rejected, state(owner).next_slot_at) == (1, 3, NOW + DAY)
    assert send(owner, other(edition, 3), at=NOW + DAY).is_new


def test_an_edition_that_is_given_up_costs_its_submissions_nothing(edition: Edition, owner: User) -> None:
    limit(rejected_limit=1)
    second = corrections.open_edition(split_name="test", protocol="toolkit", now=timezone.now(), actor=None)
    send(owner, other(edition, 1))
    corrections.discard(edition=second, reason="Not needed.", now=timezone.now(), actor=None)
    builders.score_all()
    assert sorted(Evaluation.objects.values_list("status", flat=True)) == [Status.CANCELLED, Status.SCORED]
    assert (state(owner).used, state(owner).n_rejected) == (1, 0)


@pytest.mark.slow
def test_scoring_again_costs_nothing_and_gives_nothing_back(
    edition: Edition, owner: User, tmp_path: Path
) -> None:
    limit(limit=2)
    send(owner, other(edition, 1))
    send(owner, bad(1))
    builders.score_all()
    assert (state(owner).used, state(owner).n_rejected) == (1, 1)
    corrections.open_edition(split_name="test", protocol="toolkit", now=timezone.now(), actor=None)
    assert Evaluation.objects.filter(status=Status.QUEUED).count() == 2
    assert (state(owner).used, state(owner).n_rejected) == (1, 1)
    builders.score_all()
    assert (state(owner).used, state(owner).n_rejected) == (1, 1)


def test_rejected_files_have_a_limit_of_their_own(edition: Edition, owner: User) -> None:
    limit(limit=50, rejected_limit=2)
    for number in range(2):
        send(owner, bad(number), at=NOW + number * HOUR)
    builders.score_all()
    with pytest.raises(QuotaExceeded) as caught:
        send(owner, other(edition, 1), at=NOW + 2 * HOUR)
    assert str(caught.value) == (
        "Your team has reached its limit for Test: within 24 hours, 2 files that were rejected, were "
        "cancelled, or stopped the process that read them; "
        "the next slot opens at 2026-11-21 12:00 UTC."
    )
    assert caught.value.quota.left == 50
    assert send(owner, other(edition, 1), at=NOW + DAY).is_new


def test_a_file_that_was_rejected_in_a_scoring_anew_alone_is_no_rejected_file(
    edition: Edition, owner: User
) -> None:
    limit(limit=9, rejected_limit=9)
    for priority in (Evaluation.PRIORITY_LIVE, *[Evaluation.PRIORITY_RESCORE] * 2):
        queue_rows.queued(edition, owner, priority=priority)
        lifecycle.finalise(queue_rows.claim(), queue_rows.REJECTED)
    now = state(owner, at=timezone.now())
    assert (now.used, now.n_rejected) == (0, 1)


# --- without quota, and with another one -----------------------------------------------------------------


@pytest.mark.slow
def test_a_split_without_limits_takes_any_number(edition: Edition, owner: User) -> None:
    for number in range(5):
        send(owner, other(edition, number))
    assert (state(owner).limit, state(owner).left, state(owner).used) == (None, None, 5)
    assert state(owner).sentence == "No limit."


def test_quotas_can_be_off_altogether(edition: Edition, owner: User, settings) -> None:
    limit(limit=0)
    with pytest.raises(QuotaExceeded, match="may not submit to Test") as caught:
        send(owner, other(edition, 1))
    assert caught.value.quota.retry_after_s(now=NOW) is None
    settings.QUOTAS = False
    assert send(owner, other(edition, 1)).is_new


def test_a_team_can_have_rules_of_its_own_with_a_reason(
    edition: Edition, owner: User, stranger: User, maintainer: User
) -> None:
    limit(limit=1)
    send(owner, other(edition, 1))
    send(stranger, other(edition, 1))
    reason = "The camera-ready deadline is tomorrow."
    with pytest.raises(NotMaintainer):
        builders.override(teams.team_of(user=owner), actor=owner)
    row = builders.override(teams.team_of(user=owner), limit=2, reason=reason, actor=maintainer)
    assert (state(owner).left, state(stranger).left) == (1, 0)
    event = AuditEvent.objects.get(verb="quota_overridden", actor=maintainer)
    details = {name: event.details[name] for name in ("split", "quota_limit", "reason")}
    assert details == {"split": "test", "quota_limit": 2, "reason": reason}
    usage.end_override(row=row, actor=maintainer)
    assert state(owner).left == 0
    assert AuditEvent.objects.filter(verb="quota_restored", noun_id=row.team_id).count() == 1


# --- the arithmetic --------------------------------------------------------------------------------------

minutes = st.integers(0, 4 * 24 * 60).map(lambda n: NOW + timedelta(minutes=n))
spans = st.integers(1, 3 * 24 * 60).map(lambda n: timedelta(minutes=n))
rules = st.builds(
    QuotaOverride,
    quota_limit=st.none() | st.integers(1, 4),
    quota_window=spans,
    quota_min_gap=st.just(timedelta(0)) | spans,
    quota_rejected_limit=st.none() | st.integers(1, 4),
)


@pytest.mark.slow
@given(rules=rules, spent=st.lists(minutes, max_size=8), rejected=st.lists(minutes, max_size=8), now=minutes)
def test_the_next_slot_opens_exactly_when_the_quota_says(
    rules: QuotaOverride, spent: list[datetime], rejected: list[datetime], now: datetime
) -> None:
    split = Split(name="test")

    def weighed(at: datetime) -> Quota:
        return usage.quota_at(
            split=split, rules=rules, spent=sorted(spent), rejected=sorted(rejected), now=at
        )

    quota = weighed(now)
    if quota.is_open:
        assert quota.next_slot_at is None
        assert quota.limit is None or quota.left
        return
    assert quota.next_slot_at is not None
    assert weighed(quota.next_slot_at).is_open
    assert not weighed(quota.next_slot_at - timedelta(microseconds=1)).is_open
    assert quota.retry_after_s(now=now) == (quota.next_slot_at - now).total_seconds()


def test_a_gap_longer_than_the_window_and_a_day_keeps_the_team_waiting(edition: Edition, owner: User) -> None:
    limit(limit=5, window=DAY, min_gap=7 * DAY)
    send(owner, other(edition, 1))
    for later in (2 * DAY, 7 * DAY - timedelta(seconds=1)):
        with pytest.raises(QuotaExceeded, match="at least 7 days apart"):
            send(owner, other(edition, 2), at=NOW + later)
    assert send(owner, other(edition, 2), at=NOW + 7 * DAY).is_new
