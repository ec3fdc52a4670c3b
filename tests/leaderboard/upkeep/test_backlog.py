"""`leaderboard.upkeep.backlog`: a job that fails is a state that people see, and holds up no other."""

import logging
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from django.utils import timezone

from leaderboard.models import Comparison, Edition, Evaluation, Fault, User
from leaderboard.ops import faults, health
from leaderboard.statistics import analyses, confidence
from leaderboard.storage import seeds
from tests import builders


@pytest.fixture
def scored(edition: Edition, owner: User) -> Edition:
    """A board with two entries whose statistics wait."""
    for factor in (1.1, 1.2):
        builders.submit(owner, builders.predictions(edition, factor=factor), method=f"Method {factor}")
    builders.score_all()
    return edition


def test_a_lost_seed_key_becomes_a_state_with_its_reason_and_one_line_of_the_log(
    scored: Edition, caplog: pytest.LogCaptureFixture
) -> None:
    secret = seeds.path().read_text()
    seeds.path().write_text("damaged")
    now = timezone.now()
    for _ in range(2):
        builders.infer_all()
    assert not health.failing_statistics(now=now), "what failed twice may be a restart"
    builders.infer_all()
    assert health.failing_statistics(now=now + timedelta(seconds=1)) == ["intervals"]
    fault = Fault.objects.get(kind=faults.INTERVALS)
    assert (fault.subject, fault.n_times) == (str(scored), 3)
    assert "seed.key beside the ground truth is damaged" in fault.reason
    lines = [record for record in caplog.records if "backlog_failed" in str(record.msg)]
    assert [record.levelno for record in lines] == [logging.ERROR]

    seeds.path().write_text(secret)
    builders.infer_all()

    assert not health.failing_statistics(now=timezone.now())
    assert not Comparison.objects.filter(computed_at=None).exists()


def test_one_edition_that_fails_hides_no_other_and_is_not_hidden_by_it(
    scored: Edition, owner: User, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = builders.import_truth(tmp_path, split="val", seed=1)
    builders.submit(owner, builders.predictions(other), split="val", method="Method 1.1")
    builders.score_all()
    real = confidence.infer

    def infer(entries: confidence.Entries, **options: Any) -> bool:
        if entries.edition == scored:
            raise ValueError("no such thing")
        return real(entries, **options)

    monkeypatch.setattr(confidence, "infer", infer)
    for _ in range(faults.MIN_TIMES):
        builders.infer_all()
    assert [row.subject for row in faults.present(now=timezone.now())] == [str(scored)]
    other.refresh_from_db()
    assert other.inferred_at is not None, (
        "a bug that one edition shows does not end the statistics of the next"
    )


@pytest.mark.slow
def test_one_entry_that_fails_is_not_hidden_by_those_of_its_edition_that_work(
    edition: Edition, owner: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    builders.open_values(edition)
    bad = builders.submit(owner, builders.predictions(edition, factor=1.1), method="Bad")
    builders.submit(owner, builders.predictions(edition, factor=1.2), method="Good")
    builders.score_all()
    real = analyses.make

    def make(evaluation: Evaluation, **options: Any) -> None:
        if evaluation.submission_id == bad.pk:
            raise OSError("the file is damaged")
        real(evaluation, **options)

    monkeypatch.setattr(analyses, "make", make)
    for _ in range(faults.MIN_TIMES):
        builders.infer_all()
    assert health.failing_statistics(now=timezone.now()) == ["analyses"]


def test_a_fault_that_nobody_meets_any_more_is_forgotten(db: None) -> None:
    now = timezone.now()
    for _ in range(3):
        assert faults.note(faults.ANALYSES, subject="test edition 1", reason="R", now=now) is (_ == 0)
    later = now + faults.FORGOTTEN_AFTER + timedelta(seconds=1)
    assert not faults.present(now=later).exists()
    assert faults.note(faults.ANALYSES, subject="test edition 1", reason="R", now=later)
    row = Fault.objects.get()
    assert (row.n_times, row.n_ever, row.began_at) == (1, 4, later)
