"""A worker's run over real files: parsed in the limited child, scored or rejected, nothing else touched."""

import json
import random

import pytest
from django.utils import timezone

from evaluator import evaluate, published, read_predictions
from leaderboard.editions import ground_truth
from leaderboard.models import Edition, Evaluation, Score, Status, User
from leaderboard.scoring import worker
from leaderboard.storage import truth_values
from leaderboard.submissions import submissions
from tests import builders

pytestmark = pytest.mark.slow


def good_object(edition: Edition) -> dict[str, float]:
    return json.loads(builders.predictions(edition))


def test_scores_are_the_evaluators_own_with_the_editions_decimals(edition: Edition, owner: User) -> None:
    data = builders.predictions(edition, factor=1.3)
    submission = builders.submit(owner, data)
    assert worker.run_next(rng=random.Random(0))
    truth = truth_values.load(edition.ground_truth_id)
    offline = evaluate(read_predictions(data, manifest=truth.manifest), truth)
    progress = submissions.progress(submission)
    assert progress.state == Status.SCORED
    assert edition.decimals == progress.decimals == 1
    assert progress.scores == {name: published(value, decimals=1) for name, value in offline.flat().items()}
    assert progress.counts == {name: score.count for name, score in offline.scores.items()}
    assert progress.truncated == dict(offline.truncated)
    assert progress.n_out_of_range == 1


def test_nothing_finer_than_published_is_in_the_database(edition: Edition, owner: User) -> None:
    builders.submit(owner, builders.predictions(edition, factor=1.3))
    builders.score_all()
    assert all(value == round(value, 1) for value in Score.objects.values_list("value", flat=True))
    assert "mid" not in json.dumps(Evaluation.objects.get().report)


def test_an_empty_queue_is_no_work(edition: Edition) -> None:
    assert not worker.run_next(rng=random.Random(0))


def test_an_empty_interval_has_no_score(benchmark: None, tmp_path, owner: User) -> None:
    path = tmp_path / "t.csv"
    path.write_text("anno_id,bag_stamp,cam_id,ts,track_id,ttc\n0,a,1,5,1,1.5\n1,a,1,6,1,2.5\n")
    ground_truth.import_truth(split_name="test", path=path, now=timezone.now())
    submission = builders.submit(owner, b'{"0": 1.4, "1": 2.4}')
    builders.score_all()
    scores = submissions.progress(submission).scores
    assert scores is not None
    assert scores["mid"] is not None
    assert scores["mid_negative"] is None
    assert not Score.objects.filter(interval="negative").exists()


def with_value(value: str):
    return lambda good: json.dumps(good).replace(f'"7": {good["7"]!r}', f'"7": {value}').encode()


# One of each kind; all that a file can have is in `tests/evaluator/faulty_files.py`.
REJECTED_FILES = {
    "empty file": (lambda good: b" ", "not-json"),
    "wrong top level": (lambda good: b"[1, 2]", "wrong-top-level"),
    "no rate": (
        lambda good: json.dumps({"unit": "scale_ratio", "predictions": good}).encode(),
        "bad-rate",
    ),
    "unknown key": (lambda good: json.dumps({**good, "99999": 1.0}).encode(), "unknown-keys"),
    "duplicate key": (
        lambda good: json.dumps(good).replace('"7":', '"6":').encode(),
        "duplicate-keys",
    ),
    "string": (with_value('"5.0"'), "not-a-number"),
    "NaN": (with_value("NaN"), "nan"),
    "nesting": (lambda good: b"[" * 200_000, "too-deep"),
    "not UTF-8": (lambda good: json.dumps(good).encode().replace(b"7", b"\xff", 1), "not-utf8"),
}


@pytest.mark.parametrize("name", REJECTED_FILES)
def test_faulty_file_is_rejected_and_the_next_good_one_scored(
    edition: Edition, owner: User, name: str
) -> None:
    make, code = REJECTED_FILES[name]
    bad = builders.submit(owner, make(good_object(edition)), method="Bad")
    good = builders.submit(owner, builders.predictions(edition), method="Good")
    assert builders.score_all() == 2
    rejected = submissions.progress(bad)
    assert rejected.state == Status.REJECTED
    assert code in {problem["code"] for problem in rejected.problems}
    assert rejected.n_problems >= 1
    assert rejected.scores is None
    assert all(problem["message"].endswith(".") for problem in rejected.problems)
    assert submissions.progress(good).state == Status.SCORED
    assert Evaluation.objects.get(submission=bad).attempt == 1


@pytest.mark.parametrize(
    "make",
    [
        lambda good: b"\xef\xbb\xbf" + json.dumps(good).encode(),
        with_value("Infinity"),
        with_value("-Infinity"),
        with_value("1e400"),
        lambda good: json.dumps(good, indent=4).encode(),
        lambda good: json.dumps({"unit": "ttc", "predictions": good, "meta": {"model": "x"}}).encode(),
    ],
    ids=["byte order mark", "Infinity", "-Infinity", "1e400", "indented", "envelope"],
)
def test_unusual_but_valid_file_is_scored(edition: Edition, owner: User, make) -> None:
    submission = builders.submit(owner, make(good_object(edition)))
    builders.score_all()
    assert submissions.progress(submission).state == Status.SCORED


def test_natural_keys_in_any_order_score_like_anno_ids(edition: Edition, owner: User) -> None:
    truth = truth_values.load(edition.ground_truth_id)
    values = dict(zip(truth.manifest.natural_keys, (truth.ttc_s * 1.1).tolist(), strict=True))
    shuffled = dict(sorted(values.items(), reverse=True))
    by_key = builders.submit(owner, json.dumps(shuffled).encode(), method="A")
    by_id = builders.submit(owner, builders.predictions(edition), method="B")
    builders.score_all()
    assert submissions.progress(by_key).scores == submissions.progress(by_id).scores
