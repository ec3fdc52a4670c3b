"""A file whose values look shuffled is scored, and its team is warned; hidden values play no part in it."""

from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
from django.test import Client
from django.utils import timezone

import evaluator
from evaluator.metrics.scale import Floats
from leaderboard.editions import corrections, ground_truth
from leaderboard.models import Edition, Evaluation, Split, Status, Submission, User
from leaderboard.queue import worker
from leaderboard.storage import truth_values
from leaderboard.submissions.progress import progress_of
from tests import builders, pages
from tests.evaluator.toolkit_folders import driving_folder


@pytest.fixture
def driven(benchmark: None, tmp_path: Path) -> Edition:
    """A hidden split with ground truth from a folder of annotations."""
    Split.objects.update(quota_limit=None, quota_min_gap=timedelta(0))
    path = driving_folder(tmp_path / "annotations")
    return ground_truth.import_truth(split_name="test", path=path, now=timezone.now())


@pytest.fixture
def truth(driven: Edition) -> evaluator.GroundTruth:
    return truth_values.load(driven.ground_truth_id)


@pytest.fixture
def shuffled(truth: evaluator.GroundTruth, owner: User) -> Submission:
    return scored(owner, truth, np.random.default_rng(3).permutation(truth.ttc_s))


def scored(owner: User, truth: evaluator.GroundTruth, ttc_s: Floats) -> Submission:
    submission = builders.submit(owner, evaluator.write_predictions(manifest=truth.manifest, ttc_s=ttc_s))
    builders.score_all()
    return submission


def warning_codes(submission: Submission) -> list[str]:
    progress = progress_of(submission)
    assert progress.state == Status.SCORED
    return [warning["code"] for warning in progress.warnings]


def test_shuffled_file_is_scored_and_its_team_is_warned(
    client: Client, shuffled: Submission, owner: User
) -> None:
    assert warning_codes(shuffled) == ["shuffled-values"]
    authorization = {"Authorization": f"Bearer {builders.token(owner)}"}
    document = client.get(f"/api/v1/submissions/{shuffled.pk}", headers=authorization).json()
    [warning] = document["warnings"]
    assert warning["code"] == "shuffled-values"
    assert document["scores"]["mid"] is not None
    client.force_login(owner)
    page = pages.page(client.get(f"/submissions/{shuffled.pk}/"))
    notices = page.all("p", class_="notice")
    first = page.one("p", class_="next").all("a")[0]
    assert (first.text, first.attributes["class"]) == ("Submit a corrected file", "button")
    assert [f"Warning. {warning['message']} Code: shuffled-values"] == [notice.text for notice in notices]


def test_good_file_has_no_warning(client: Client, truth: evaluator.GroundTruth, owner: User) -> None:
    submission = scored(owner, truth, truth.ttc_s * 1.1)
    assert warning_codes(submission) == []
    client.force_login(owner)
    assert "Warning." not in client.get(f"/submissions/{submission.pk}/").content.decode()


@pytest.mark.slow
def test_warnings_are_the_same_whatever_the_hidden_values_are(
    truth: evaluator.GroundTruth,
    shuffled: Submission,
    owner: User,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Smooth under the keys and false throughout: only hidden values could tell."""
    mirrored = scored(owner, truth, -truth.ttc_s)
    table = truth.to_table()
    table.ttc_s = np.random.default_rng(4).permutation(truth.ttc_s).tolist()
    corrected = tmp_path / "corrected.csv"
    corrected.write_bytes(evaluator.GroundTruth.from_table(table).to_csv())
    corrections.open_edition(split_name="test", path=corrected, now=timezone.now(), actor=None)
    # They are known from the edition before.
    monkeypatch.delattr(worker, "warnings_of")
    builders.score_all()
    for submission, codes in ((mirrored, []), (shuffled, ["shuffled-values"])):
        reports = [row.report for row in Evaluation.objects.filter(submission=submission) if row.report]
        assert [[warning["code"] for warning in report["warnings"]] for report in reports] == [codes] * 2
