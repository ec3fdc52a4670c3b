"""Limits on files besides slots: bytes per day, and files that stop the process that reads them."""

from pathlib import Path

import pytest
from pytest_django import Settings

from leaderboard.models import Edition, Evaluation, Status, User
from leaderboard.queue import lifecycle
from leaderboard.quotas.usage import QuotaExceeded
from leaderboard.submissions.progress import progress_of
from tests import builders
from tests.leaderboard.quotas.test_usage import HOUR, NOW, bad, limit, other, send, state
from tests.leaderboard.web.maintain import queue_rows


def test_a_file_that_stops_its_reader_counts_as_rejected_until_a_maintainer_retries_it(
    edition: Edition, owner: User, maintainer: User
) -> None:
    limit(limit=3, rejected_limit=1)
    sent = send(owner, other(edition, 1)).submission
    queue_rows.strike_out()
    assert (state(owner).used, state(owner).n_rejected) == (0, 1)
    assert progress_of(sent).sentence.endswith("Until then it counts as a rejected file for 24 hours.")
    with pytest.raises(QuotaExceeded, match="or stopped the process that read them"):
        send(owner, other(edition, 2))
    lifecycle.retry(evaluation=Evaluation.objects.get(), actor=maintainer)
    assert (state(owner).used, state(owner).n_rejected) == (1, 0)


def test_a_machine_that_fails_counts_against_nobody(edition: Edition, owner: User) -> None:
    limit(rejected_limit=1)
    sent = send(owner, other(edition, 1)).submission
    for _ in range(lifecycle.MAX_INFRASTRUCTURE_STRIKES):
        queue_rows.make_due()
        queue_rows.give_back(queue_rows.claim())
    assert Evaluation.objects.get().status == Status.SYSTEM_ERROR
    assert state(owner).n_rejected == 0
    assert "counts as a rejected" not in progress_of(sent).sentence


def sized(n_bytes: int, number: int) -> bytes:
    """A file of that size which is rejected, and which no other number has."""
    return bad(number).ljust(n_bytes)


@pytest.mark.slow
def test_a_team_sends_so_many_bytes_a_day_to_all_splits_together(
    edition: Edition, owner: User, teammate: User, settings: Settings, tmp_path: Path
) -> None:
    builders.import_truth(tmp_path, split="val", seed=1)
    settings.MAX_TEAM_BYTES_PER_DAY = 1000
    send(owner, sized(400, 1))
    send(teammate, sized(500, 2), at=NOW + HOUR, split="val")
    builders.score_all()
    assert state(owner).n_rejected == 1
    send(owner, sized(100, 3), at=NOW + 2 * HOUR)
    with pytest.raises(QuotaExceeded) as caught:
        send(owner, sized(401, 4), at=NOW + 3 * HOUR)
    assert str(caught.value) == (
        "Your team has sent 1,000 bytes within 24 hours, and this file has 401; expected at most 1,000 bytes "
        "together; there is room for it at 2026-11-21 13:00 UTC."
    )
    assert caught.value.quota.retry_after_s(now=NOW + 3 * HOUR) == 22 * 3600
    assert len(list((tmp_path / "files" / "predictions").rglob("*.json"))) == 3, "none was written"
    assert not send(owner, sized(400, 1), at=NOW + 3 * HOUR).is_new, "the same bytes again are known"
    assert send(owner, sized(401, 4), at=NOW + 25 * HOUR).is_new


def test_a_file_larger_than_the_bytes_of_a_day_has_no_day(
    edition: Edition, owner: User, settings: Settings
) -> None:
    settings.MAX_TEAM_BYTES_PER_DAY = 1000
    with pytest.raises(QuotaExceeded, match=r"this file has 1,001; expected at most 1,000 bytes together\.$"):
        send(owner, sized(1001, 1))
    settings.MAX_TEAM_BYTES_PER_DAY = 0
    assert send(owner, sized(1001, 1)).is_new
