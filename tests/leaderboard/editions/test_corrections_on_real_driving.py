"""Corrections of real ground truth: what the preview says is what `tsttc score` says, number by number and
word by word.

The data may not be copied into this repository. It is used in place where `TSTTC_SHARED_DATA`, or
`shared/data` beside the checkout, has it; elsewhere these tests are skipped.
"""

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from django.utils import timezone

import evaluator
from leaderboard.editions import ground_truth, preview
from leaderboard.editions.history import TruthChange
from leaderboard.models import Edition, Status, Submission, User
from tests import builders
from tests.editions import open_edition
from tests.services import REPOSITORY

pytestmark = pytest.mark.slow

ESTIMATORS = ("box-height", "box-sqrt-area", "box-area", "pointrcnn-height")
FORMS = ("ttc", "scale_ratio")
PERTURBED = "0005"


@dataclass(frozen=True)
class Offline:
    """What `tsttc score` says of a file."""

    exit_code: int
    answer: dict[str, Any]

    @property
    def scores(self) -> dict[str, float | None]:
        """The ten numbers as they are published."""
        return {
            name: evaluator.published(self.answer["scores"][interval or "overall"][metric], decimals=1)
            for name in evaluator.SCORE_NAMES
            for metric, _, interval in [name.partition("_")]
        }


def tsttc_score(predictions: Path, *, truth: Path) -> Offline:
    """Run the command as a researcher does."""
    command = [sys.executable, "-m", "evaluator", "score", str(predictions), "--truth", str(truth), "--json"]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    return Offline(exit_code=done.returncode, answer=json.loads(done.stdout))


@pytest.fixture
def published(benchmark: None, kitti: Path, settings: Any) -> Edition:
    """The split `test` with the real ground truth; the owner may send as much as there is."""
    settings.QUOTAS = False
    return ground_truth.import_truth(split_name="test", path=kitti / "truth.csv", now=timezone.now())


@pytest.fixture
def sent(published: Edition, kitti: Path, owner: User) -> dict[Submission, Path]:
    """The four estimators in both forms, scored, and their files."""
    files = {
        f"{estimator} ({form})": kitti / "predictions" / f"{estimator}.{form}.json"
        for estimator in ESTIMATORS
        for form in FORMS
    }
    made = {builders.submit(owner, path.read_bytes(), method=name): path for name, path in files.items()}
    builders.score_all()
    return made


def correction(kitti: Path, tmp_path: Path) -> Path:
    """The truth with one recording a little farther in time."""
    head, *rows = [line.split(",") for line in (kitti / "truth.csv").read_text().splitlines()]
    changed = [[*key, repr(float(ttc_s) * 1.07) if key[1] == PERTURBED else ttc_s] for *key, ttc_s in rows]
    path = tmp_path / "corrected.csv"
    path.write_text("\n".join(",".join(row) for row in [head, *changed]) + "\n")
    return path


def test_preview_of_a_corrected_recording_has_the_figures_of_two_offline_runs(
    sent: dict[Submission, Path], kitti: Path, tmp_path: Path
) -> None:
    path = correction(kitti, tmp_path)
    edition = open_edition(path)
    builders.score_all()
    found = preview.preview(edition)
    assert found.truth == TruthChange(n_added=0, n_removed=0, n_changed=900, n_renumbered=0)
    files = {submission.pk: file for submission, file in sent.items()}
    assert {change.submission_id for change in found.changes} == set(files)
    for change in found.changes:
        file = files[change.submission_id]
        before, after = tsttc_score(file, truth=kitti / "truth.csv"), tsttc_score(file, truth=path)
        assert (before.exit_code, after.exit_code) == (0, 0)
        assert change.old == before.scores
        assert change.new == after.scores
        assert change.old != change.new
        assert (change.old_status, change.new_status) == (Status.SCORED, Status.SCORED)
