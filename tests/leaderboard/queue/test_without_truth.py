"""A worker that cannot read the ground truth: it takes nothing on that it cannot do, and says so."""

import random
import shutil
from pathlib import Path

import pytest
from django.test import Client
from pytest_django import Settings

from leaderboard.models import Edition, Evaluation, Submission, User
from leaderboard.queue import worker
from leaderboard.storage import truth_values
from leaderboard.upkeep import pollers
from tests import builders
from tests.caching import forget_boards

RNG = random.Random(0)


@pytest.fixture
def waiting(edition: Edition, owner: User) -> Submission:
    """A submission that waits."""
    return builders.submit(owner, builders.predictions(edition))


def take_away(settings: Settings) -> Path:
    """The private directory, somewhere else now."""
    aside = Path(settings.GROUND_TRUTH_DIR).with_name("elsewhere")
    shutil.move(settings.GROUND_TRUTH_DIR, aside)
    truth_values.load.cache_clear()
    return aside


def state(submission: Submission) -> tuple[str, int, int, int]:
    row = Evaluation.objects.get(submission=submission)
    return row.status, row.attempt, row.n_poison_strikes, row.n_infrastructure_strikes


@pytest.mark.slow
def test_a_worker_without_ground_truth_claims_nothing_and_nobody_is_struck(
    waiting: Submission, settings: Settings
) -> None:
    aside = take_away(settings)
    for _ in range(20):
        assert not worker.run_next(rng=RNG)
    assert state(waiting) == ("QUEUED", 0, 0, 0)
    shutil.move(aside, settings.GROUND_TRUTH_DIR)
    assert worker.run_next(rng=RNG)
    assert state(waiting) == ("SCORED", 1, 0, 0)


def test_a_worker_with_another_ground_truth_does_what_it_can(
    waiting: Submission, owner: User, tmp_path: Path
) -> None:
    other = builders.import_truth(tmp_path, split="val", seed=1)
    builders.submit(owner, builders.predictions(other), split="val")
    truth_values.values_path(waiting.split.current_edition.ground_truth_id).unlink()
    assert builders.score_all() == 1
    assert state(waiting) == ("QUEUED", 0, 0, 0)


@pytest.mark.django_db(transaction=True)
def test_the_sweep_says_so_in_the_log_and_healthy_to_monitors(
    waiting: Submission, settings: Settings, caplog: pytest.LogCaptureFixture
) -> None:
    aside = take_away(settings)
    pollers.sweep(rng=RNG)
    assert "ground_truth_out_of_reach" in caplog.text
    assert healthiness() == (503, False)
    shutil.move(aside, settings.GROUND_TRUTH_DIR)
    pollers.sweep(rng=RNG)
    assert healthiness() == (200, True)


def healthiness() -> tuple[int, bool]:
    forget_boards()
    response = Client().get("/healthy")
    return response.status_code, response.json()["checks"]["ground truth"]["ok"]
