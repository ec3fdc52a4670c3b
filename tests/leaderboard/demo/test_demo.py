"""The demo's contents: simulated truth of the right shape, submissions that the real worker decides."""

import random
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path

import pytest
from django.contrib.auth.models import AnonymousUser
from django.core.management import CommandError, call_command
from pytest_django.fixtures import Settings

import evaluator
from leaderboard.boards import listing
from leaderboard.demo import seed
from leaderboard.demo.runs import N_RECORDINGS, N_SEQUENCES, demo_split
from leaderboard.editions import ground_truth
from leaderboard.errors.refusals import Refused
from leaderboard.models import Evaluation, Split, Status, Submission, User
from leaderboard.queue import worker

pytestmark = pytest.mark.slow

NOW = datetime(2026, 1, 1, tzinfo=UTC)


@pytest.fixture(scope="module")
def truth() -> evaluator.GroundTruth:
    return demo_split().truth


def test_the_simulated_truth_has_the_size_and_the_recordings_of_the_test_set(
    truth: evaluator.GroundTruth,
) -> None:
    assert truth.n_sequences == N_SEQUENCES == 28_600
    assert truth.manifest.n_recordings == N_RECORDINGS == 700


def test_the_same_seed_gives_the_same_truth_and_the_same_files(truth: evaluator.GroundTruth) -> None:
    again = demo_split().truth
    assert again.digest == truth.digest
    for entry in seed.ENTRIES:
        assert seed.predictions_file(entry, truth=again) == seed.predictions_file(entry, truth=truth)


@pytest.mark.slow
def test_the_worker_decides_what_the_seed_submits(benchmark: None, tmp_path: Path) -> None:
    seed.seed(now=NOW, password_path=tmp_path / "password")
    assert Counter(Evaluation.objects.values_list("status", flat=True)) == {Status.QUEUED: len(seed.ENTRIES)}

    while worker.run_next(rng=random.Random(1)):
        continue

    n_scored = sum(entry.run is not None for entry in seed.ENTRIES)
    assert Counter(Evaluation.objects.values_list("status", flat=True)) == {
        Status.SCORED: n_scored,
        Status.REJECTED: 1,
    }
    board = listing.board(split=Split.objects.get(pk="demo"), viewer=AnonymousUser())
    assert [entry.rank for entry in board.entries] == [*range(1, n_scored + 1)]
    assert board.entries[0].method == "Deep Scale features, own fit"
    assert board.split.is_simulated


def test_seeding_twice_adds_nothing_and_keeps_the_password(benchmark: None, tmp_path: Path) -> None:
    path = tmp_path / "password"
    password = seed.seed(now=NOW, password_path=path)
    assert path.stat().st_mode & 0o077 == 0
    counts = [model.objects.count() for model in (User, Submission, Evaluation)]

    assert seed.seed(now=NOW, password_path=path) == password
    assert [model.objects.count() for model in (User, Submission, Evaluation)] == counts
    assert User.objects.get(email=seed.DEMO_EMAIL).check_password(password)
    maintainer = User.objects.get(email=seed.MAINTAINER_EMAIL)
    assert maintainer.is_maintainer
    assert maintainer.check_password(password)
    others = User.objects.exclude(email__in=[seed.DEMO_EMAIL, seed.MAINTAINER_EMAIL])
    assert not any(user.has_usable_password() for user in others), "nobody signs in as the baselines' teams"


def test_a_demo_split_with_other_ground_truth_is_left_alone(benchmark: None, tmp_path: Path) -> None:
    other = tmp_path / "other.csv"
    other.write_text("anno_id,bag_stamp,cam_id,ts,track_id,ttc\n0,a,1,600000000,1,5.0\n")
    ground_truth.import_truth(split_name="demo", path=other, now=NOW)
    with pytest.raises(Refused, match="expected none"):
        seed.seed(now=NOW, password_path=tmp_path / "password")
    assert not Submission.objects.exists()


def test_production_has_no_demo(benchmark: None, settings: Settings) -> None:
    settings.PRODUCTION = True
    for command in ("seed_demo", "demo"):
        with pytest.raises(CommandError, match="production"):
            call_command(command)
    assert not User.objects.exists()
