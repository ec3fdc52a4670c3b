"""A worker's run over real files: parsed in the limited child, scored or rejected, nothing else touched."""

import itertools
import json
import random
import time

import pytest
from django.utils import timezone
from pytest_django import Settings

from evaluator import evaluate, read_predictions, rounded
from leaderboard.editions import ground_truth
from leaderboard.models import Edition, Evaluation, Score, Status, Submission, User
from leaderboard.queue import worker
from leaderboard.storage import files, truth_values
from leaderboard.submissions.progress import progress_of
from tests import builders


@pytest.mark.slow
def test_scores_are_the_evaluators_own_with_the_editions_decimals(edition: Edition, owner: User) -> None:
    data = builders.predictions(edition, factor=1.3)
    submission = builders.submit(owner, data)
    assert worker.run_next(rng=random.Random(0))
    truth = truth_values.load(edition.ground_truth_id)
    offline = evaluate(read_predictions(data, manifest=truth.manifest), truth)
    progress = progress_of(submission)
    assert progress.state == Status.SCORED
    assert edition.decimals == progress.decimals == 1
    assert progress.scores == {name: rounded(value, decimals=1) for name, value in offline.flat().items()}
    assert progress.counts == {name: score.count for name, score in offline.scores.items()}
    assert progress.truncated == dict(offline.truncated)
    assert progress.n_out_of_range == 1


def test_nothing_finer_than_published_is_in_the_database(edition: Edition, owner: User) -> None:
    builders.submit(owner, builders.predictions(edition, factor=1.3))
    builders.score_all()
    assert all(value == round(value, 1) for value in Score.objects.values_list("value", flat=True))
    assert "mid" not in json.dumps(Evaluation.objects.get().report)


def test_an_empty_interval_has_no_score(benchmark: None, tmp_path, owner: User) -> None:
    path = tmp_path / "t.csv"
    path.write_text("anno_id,bag_stamp,cam_id,ts,track_id,ttc\n0,a,1,5,1,1.5\n1,a,1,6,1,2.5\n")
    ground_truth.import_truth(split_name="test", path=path, now=timezone.now())
    submission = builders.submit(owner, b'{"0": 1.4, "1": 2.4}')
    builders.score_all()
    scores = progress_of(submission).scores
    assert scores is not None
    assert scores["mid"] is not None
    assert scores["mid_negative"] is None
    assert not Score.objects.filter(ttc_range="negative").exists()


# All that a file can have is in `tests/evaluator/faulty_files.py`.
@pytest.mark.parametrize(
    ("bad_file", "code"),
    [(b"[1, 2]", "wrong-top-level"), (b"[" * 200_000, "too-deep")],
    ids=["list", "nesting"],
)
def test_faulty_file_is_rejected_and_the_next_good_one_scored(
    edition: Edition, owner: User, bad_file: bytes, code: str
) -> None:
    bad = builders.submit(owner, bad_file, method="Bad")
    good = builders.submit(owner, builders.predictions(edition), method="Good")
    assert builders.score_all() == 2
    rejected = progress_of(bad)
    assert (rejected.state, rejected.scores) == (Status.REJECTED, None)
    assert [problem["code"] for problem in rejected.problems] == [code]
    assert progress_of(good).state == Status.SCORED
    assert Evaluation.objects.get(submission=bad).attempt == 1


class Clock:
    """A clock that goes on by so much whenever somebody looks at it."""

    sleep = staticmethod(time.sleep)

    def __init__(self, *, step_s: float) -> None:
        self._seconds = itertools.count(0.0, step_s)

    def monotonic(self) -> float:
        return next(self._seconds)


@pytest.mark.parametrize(("step_s", "n_read"), [(0.001, 4), (1_000.0, 1)])
def test_a_batch_that_takes_longer_than_half_its_lease_is_handed_back_without_a_strike(
    second: Edition, settings: Settings, monkeypatch: pytest.MonkeyPatch, step_s: float, n_read: int
) -> None:
    # Without kept values, each file of the batch is read again, alone.
    for sent in Submission.objects.all():
        files.store().delete(files.aligned_name(manifest_digest=sent.manifest_digest, digest=sent.digest))
    monkeypatch.setattr(worker, "time", Clock(step_s=step_s))
    settings.LEASE_S, settings.WALL_S = 60.0, 100_000.0
    assert worker.run_next(rng=random.Random(0))
    rows = Evaluation.objects.filter(edition=second)
    assert sorted(row.status for row in rows) == ["QUEUED"] * (4 - n_read) + ["SCORED"] * n_read
    assert {(row.n_poison_strikes, row.n_infrastructure_strikes) for row in rows} == {(0, 0)}
    monkeypatch.undo()
    builders.score_all()
    assert {row.status for row in rows.all()} == {Status.SCORED}
