"""The closer look at a submission: for its owner, on open splits, and never of a hidden one."""

from pathlib import Path

import numpy as np
import pytest
from django.utils import timezone

import evaluator
from evaluator import get_protocol
from evaluator.metrics.registry import WARNING_S
from leaderboard.models import Analysis, Edition, Split, Submission, User
from leaderboard.statistics import analyses
from leaderboard.storage import files, truth_values
from leaderboard.upkeep import backlog
from leaderboard.web.charts import analysis_charts
from tests import builders
from tests.editions import ANYBODY


@pytest.fixture
def val(benchmark: None, tmp_path: Path) -> Edition:
    """An open split."""
    Split.objects.filter(pk="val").update(is_hidden=False)
    return builders.import_truth(tmp_path, split="val")


@pytest.fixture
def sent(val: Edition, owner: User) -> Submission:
    """A scored submission to it, and what workers make of it afterwards."""
    made = builders.submit(owner, builders.predictions(val), split="val")
    builders.score_all()
    builders.infer_all()
    return made


def plain(submission: Submission, edition: Edition) -> evaluator.Report:
    truth = truth_values.load(edition.ground_truth_id)
    with files.opened_predictions(submission.digest) as kept:
        predictions = evaluator.read_predictions(kept.read(), manifest=truth.manifest)
    return evaluator.evaluate(predictions, truth, keep_sequences=True)


def test_the_owner_sees_what_a_plain_loop_finds(sent: Submission, val: Edition, owner: User) -> None:
    closer = analyses.for_submission(submission=sent, viewer=owner)
    assert closer is not None
    content, truth = closer.content, truth_values.load(val.ground_truth_id)
    sequences = plain(sent, val).sequences
    assert sequences is not None
    assert (content["n_sequences"], content["n_recordings"]) == (120, 24)
    for part in content["curve"]:
        rows = [i for i, tau in enumerate(truth.ttc_s) if part["low_s"] <= tau < part["high_s"]]
        assert part["n"] == len(rows) > 0
        assert part["mid"] == pytest.approx(float(np.mean(sequences["mid"][rows])), abs=0.0051)
        assert part["rte"] == pytest.approx(float(np.mean(sequences["rte"][rows])), abs=0.0051)
        for name, (low, high) in part["intervals"].items():
            assert low <= part[name] <= high
    assert any(part["intervals"] for part in content["curve"])
    assert sum(part["n"] for part in content["curve"]) == int((np.abs(truth.ttc_s) < 20).sum())
    assert sum(part["n"] for part in content["histogram"]) == 120
    assert content["histogram"][-1]["high"] is None
    median = next(row["value"] for row in content["distribution"]["mid"] if row["quantile"] == 0.5)
    assert median == pytest.approx(float(np.median(sequences["mid"])), abs=0.0051)
    points = content["scatter"]
    assert len(points["true_s"]) == len(points["predicted_s"]) == 120
    assert max(map(abs, points["predicted_s"])) <= 20
    worst = content["worst"]
    assert len(worst) == analyses.MAX_RECORDINGS
    bags = np.array(truth.manifest.bag_stamp)
    assert [row["mid"] for row in worst] == sorted((row["mid"] for row in worst), reverse=True)
    for row in worst:
        own = sequences["mid"][bags == row["recording"]]
        assert (row["n"], row["mid"]) == (len(own), pytest.approx(float(own.mean()), abs=0.0051))


def test_missed_warnings_and_false_alarms_are_what_a_plain_loop_counts(val: Edition, owner: User) -> None:
    truth = truth_values.load(val.ground_truth_id)
    # Multiples of the truth on both sides of it, and some with the other sign.
    predicted_s = truth.ttc_s * np.resize([1.5, 0.3, 0.1, -1.0], truth.n_sequences)
    predictions = evaluator.Predictions.from_arrays(ttc_s=predicted_s, manifest=truth.manifest)
    content = analyses.content_of(predictions, truth, rules=get_protocol("tsttc-2"))
    report = evaluator.evaluate(predictions, truth, protocol="tsttc-2", keep_sequences=True)
    assert [row["threshold_s"] for row in content["warnings"]] == list(analyses.THRESHOLDS_S)
    for row in content["warnings"]:
        due, other, n_missed, n_false = 0, 0, 0, 0
        for tau, predicted in zip(
            truth.ttc_s.tolist(), report.require_details().predicted_ttc_s, strict=True
        ):
            warns = 0 < predicted <= row["threshold_s"]
            if 0 < tau <= row["threshold_s"]:
                due, n_missed = due + 1, n_missed + (not warns)
            else:
                other, n_false = other + 1, n_false + warns
        for side, n, n_wrong in (("missed", due, n_missed), ("false", other, n_false)):
            assert row[side]["n"] == n
            assert row[side]["share"] == pytest.approx(100 * n_wrong / n, abs=0.0051)
            low, high = row[side]["interval"] or (0, 100)
            assert low <= row[side]["share"] <= high
        if row["threshold_s"] == WARNING_S:
            assert report.flat()["warning"] == pytest.approx(100 * (n_missed + n_false) / (due + other))
    assert any(row["false"]["interval"] for row in content["warnings"])
    assert "warnings" not in analyses.content_of(predictions, truth, rules=get_protocol("tsttc-1"))


def test_without_a_warning_due_there_is_no_share(val: Edition) -> None:
    table = truth_values.load(val.ground_truth_id).to_table()
    table.ttc_s = [abs(tau) + 5 for tau in table.ttc_s]
    truth = evaluator.GroundTruth.from_table(table)
    predictions = evaluator.Predictions.from_arrays(ttc_s=truth.ttc_s, manifest=truth.manifest)
    content = analyses.content_of(predictions, truth, rules=get_protocol("tsttc-2"))
    assert all(row["missed"] == {"n": 0, "share": None, "interval": None} for row in content["warnings"])
    chart = analysis_charts.warnings(content["warnings"])
    assert all(row[1:3] == ("0", "–") for row in chart.rows)


def test_a_closer_look_is_for_the_team_alone(
    sent: Submission, owner: User, teammate: User, stranger: User, maintainer: User
) -> None:
    assert analyses.for_submission(submission=sent, viewer=teammate) == analyses.for_submission(
        submission=sent, viewer=maintainer
    )
    assert analyses.for_submission(submission=sent, viewer=teammate) is not None
    assert analyses.for_submission(submission=sent, viewer=stranger) is None
    assert analyses.for_submission(submission=sent, viewer=ANYBODY) is None


def test_nothing_of_a_hidden_split_is_looked_at(entries: list[Submission], owner: User) -> None:
    builders.infer_all()
    assert Split.objects.get(pk="test").is_hidden
    assert not Analysis.objects.exists()
    assert analyses.for_submission(submission=entries[0], viewer=owner) is None


def test_a_split_that_is_hidden_later_shows_and_keeps_nothing(
    sent: Submission, val: Edition, owner: User
) -> None:
    Split.objects.filter(pk="val").update(is_hidden=True)
    sent.refresh_from_db()
    assert analyses.for_submission(submission=Submission.objects.get(pk=sent.pk), viewer=owner) is None
    analyses.delete_hidden()
    assert not Analysis.objects.exists()
    analyses.make(val.evaluations.get(), now=timezone.now())
    assert not Analysis.objects.exists()


def test_hidden_values_are_looked_at_by_no_worker_whatever_the_database_calls_their_split(
    edition: Edition, owner: User
) -> None:
    submission = builders.submit(owner, builders.predictions(edition))
    builders.score_all()
    # As somebody who has the web process could.
    Split.objects.filter(pk="test").update(is_hidden=False)
    builders.infer_all()
    analyses.make(submission.evaluations.get(), now=timezone.now())
    assert not Analysis.objects.exists()


@pytest.mark.slow
def test_a_file_that_cannot_be_read_keeps_no_other_analysis_waiting(
    val: Edition, owner: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    readable = builders.submit(owner, builders.predictions(val), split="val")
    lost = builders.submit(owner, builders.predictions(val, factor=1.2), split="val", method="Lost")
    builders.score_all()
    file = lost.sent_file
    aligned = files.aligned_name(manifest_digest=file.manifest_digest, digest=file.digest)
    for name in (files.predictions_name(lost.digest), aligned):
        files.store().delete(name)
    monkeypatch.setattr(backlog, "MAX_AT_ONCE", 1)
    for _ in range(40):  # each time one of the two is tried
        builders.infer_all()
    assert [row.evaluation.submission for row in Analysis.objects.all()] == [readable]


def test_many_sequences_give_a_bounded_number_of_points(val: Edition) -> None:
    truth = evaluator.GroundTruth.from_table(truth_values.load(val.ground_truth_id).to_table())
    rng = np.random.default_rng(3)
    n = 2_000
    table = truth.to_table()
    table.anno_id = list(range(n))
    table.bag_stamp = [f"{row // 40:04d}" for row in range(n)]
    table.cam_id, table.track_id = ["1"] * n, ["1"] * n
    table.ts_ns = [1_000 * row for row in range(n)]
    table.ttc_s = rng.uniform(0.3, 25, n).tolist()
    truth = evaluator.GroundTruth.from_table(table)
    predictions = evaluator.Predictions.from_arrays(
        ttc_s=truth.ttc_s * rng.choice([-1e-3, 1e-3, 1, 30], n), manifest=truth.manifest
    )
    content = analyses.content_of(predictions, truth, rules=get_protocol("tsttc-1"))
    points = content["scatter"]["predicted_s"]
    assert len(points) == analyses.MAX_POINTS
    assert all(0.05 <= point <= 20 or -20 <= point <= -0.15 for point in points)
    assert all(row["n"] > 0 for row in content["curve"])
