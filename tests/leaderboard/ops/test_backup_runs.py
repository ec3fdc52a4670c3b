"""The record of backups."""

from datetime import timedelta

import pytest
from django.utils import timezone

from leaderboard.models import BackupRun
from leaderboard.ops import backup_runs

pytestmark = pytest.mark.django_db

HOUR = timedelta(hours=1)


def test_a_failure_before_the_last_good_backup_is_of_no_interest():
    now = timezone.now()
    first = backup_runs.begin(now - 3 * HOUR)
    backup_runs.finish(first, now=now - 2 * HOUR, is_ok=False, fault="the disk is full")
    assert backup_runs.failed_since_good(now=now).get() == first
    assert backup_runs.last_good() is None

    second = backup_runs.begin(now - HOUR)
    backup_runs.finish(second, now=now, is_ok=True, n_files=4)

    assert backup_runs.last_good() == second
    assert not backup_runs.failed_since_good(now=now).exists()


def test_a_failure_after_the_last_good_backup_is_kept_with_its_reason():
    now = timezone.now()
    good = backup_runs.begin(now - 3 * HOUR)
    backup_runs.finish(good, now=now - 2 * HOUR, is_ok=True, n_files=4)
    bad = backup_runs.begin(now - HOUR)
    backup_runs.finish(
        bad, now=now, is_ok=False, n_files=3, n_damaged=1, fault="predictions/ab.json: damaged"
    )

    failed = backup_runs.failed_since_good(now=now).first()

    assert failed is not None
    assert (failed.n_files, failed.n_damaged, failed.fault) == (3, 1, "predictions/ab.json: damaged")
    assert backup_runs.last_good() == good


def test_the_last_good_backup_is_remembered_however_old_it_is():
    now = timezone.now()
    good, bad = (BackupRun.objects.create(started_at=now - timedelta(days=900 + day)) for day in (0, 1))
    backup_runs.finish(good, now=good.started_at + HOUR, is_ok=True)
    backup_runs.finish(bad, now=bad.started_at + HOUR, is_ok=False, fault="full")

    backup_runs.begin(now)

    assert backup_runs.last_good() == good
    assert not BackupRun.objects.filter(pk=bad.pk).exists()


def test_a_backup_that_was_refused_during_a_good_one_is_of_no_interest():
    now = timezone.now()
    good, refused, later = (backup_runs.begin(now - hours * HOUR) for hours in (5, 4, 3))
    backup_runs.finish(refused, now=now - 4 * HOUR, is_ok=False, fault="Another backup is being written")
    backup_runs.finish(good, now=now - 2 * HOUR, is_ok=True, n_files=4)
    assert not backup_runs.failed_since_good(now=now).exists()
    # This one began during the good one as well, and ended badly after it.
    backup_runs.finish(later, now=now - HOUR, is_ok=False, fault="the disk is full")
    assert backup_runs.failed_since_good(now=now).get() == later
