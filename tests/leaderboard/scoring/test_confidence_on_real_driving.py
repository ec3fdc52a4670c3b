"""Intervals, ranges and comparisons of four estimators on real driving, through the server, against loops.

The data may not be copied into this repository. It is used in place where `TSTTC_SHARED_DATA`, or
`shared/data` beside the checkout, has it; elsewhere these tests are skipped. It has eleven recordings, too
few for an interval; with each object's track as a recording of its own there are enough.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from django.utils import timezone
from scipy import stats

from evaluator import SCORE_NAMES, evaluate, published, read_predictions
from evaluator.scoring import uncertainty
from leaderboard.editions import ground_truth
from leaderboard.models import Edition, Split, Submission, User
from leaderboard.scoring import comparisons, verdicts
from leaderboard.storage import truth_values
from tests import builders
from tests.editions import ANYBODY, board_now
from tests.evaluator.recordings import permutation_p

pytestmark = pytest.mark.slow

ESTIMATORS = ("box-height", "box-sqrt-area", "box-area", "pointrcnn-height")


def opened(kitti: Path, path: Path, settings: Any) -> Edition:
    settings.QUOTAS = False
    Split.objects.filter(pk="test").update(is_hidden=False, decimals=2)
    return ground_truth.import_truth(split_name="test", path=path, now=timezone.now())


def send(kitti: Path, owner: User) -> dict[str, Submission]:
    sent = {
        name: builders.submit(owner, (kitti / "predictions" / f"{name}.ttc.json").read_bytes(), method=name)
        for name in ESTIMATORS
    }
    builders.score_all()
    return sent


def by_track(kitti: Path, tmp_path: Path) -> Path:
    """The truth with every track as a recording."""
    head, *rows = [line.split(",") for line in (kitti / "truth.csv").read_text().splitlines()]
    column = {name: i for i, name in enumerate(head)}
    for row in rows:
        row[column["bag_stamp"]] += f"-{row[column['track_id']]}"
    path = tmp_path / "by-track.csv"
    path.write_text("\n".join(",".join(row) for row in [head, *rows]) + "\n")
    return path


def test_eleven_recordings_have_no_interval_and_the_board_can_say_why(
    benchmark: None, kitti: Path, owner: User, settings: Any
) -> None:
    edition = opened(kitti, kitti / "truth.csv", settings)
    send(kitti, owner)
    builders.infer_all()
    submitted = [entry for entry in board_now().entries if entry.kind == "submission"]
    assert len(submitted) == 4
    assert all(interval.low is None for entry in submitted for interval in entry.intervals.values())
    edition.refresh_from_db()
    assert edition.n_effective["mid"] < 8
    assert "too few recordings (effective number " in verdicts.why_no_interval(edition)


def test_what_stands_on_the_board_is_what_a_loop_finds_in_the_files(
    benchmark: None, kitti: Path, owner: User, settings: Any, tmp_path: Path
) -> None:
    edition = opened(kitti, by_track(kitti, tmp_path), settings)
    sent = send(kitti, owner)
    builders.infer_all()
    truth = truth_values.load(edition.ground_truth_id)
    n_bags = truth.manifest.n_recordings
    assert n_bags > 100
    errors = {}
    for name in ESTIMATORS:
        data = (kitti / "predictions" / f"{name}.ttc.json").read_bytes()
        assert len(json.loads(data)) == truth.n_sequences
        report = evaluate(read_predictions(data, manifest=truth.manifest), truth, keep_sequences=True)
        assert report.sequences is not None
        errors[name] = report.sequences["mid"]
    weights = uncertainty.generator_of(truth.digest, purpose="weights").standard_exponential(
        (10_000, n_bags), dtype=np.float32
    )
    parts = {"mid": (-np.inf, np.inf), "mid_crucial": (0, 3), "mid_negative": (-20, 0)}
    rows = {entry.method: entry for entry in board_now().entries if entry.kind == "submission"}
    for name, column in ((name, column) for name in ESTIMATORS for column in parts):
        inside = (truth.ttc_s >= parts[column][0]) & (truth.ttc_s <= parts[column][1])
        sums, counts = np.zeros(n_bags), np.zeros(n_bags)
        for row in np.flatnonzero(inside):
            sums[truth.manifest.recording_index[row]] += errors[name][row]
            counts[truth.manifest.recording_index[row]] += 1
        effective = counts.sum() ** 2 / (counts**2).sum()
        degrees = (counts**2).sum() ** 2 / (counts**4).sum()
        tail = stats.norm.cdf(-stats.t.ppf(0.975, degrees) * (effective / (effective - 1)) ** 0.5)
        expected = np.quantile((weights @ sums) / (weights @ counts), [tail, 1 - tail])
        found = rows[name].intervals[column]
        assert (found.low, found.high) == pytest.approx(tuple(expected), rel=2e-4, abs=0.006), (name, column)
        assert found.low <= rows[name].scores[column] <= found.high
        assert 1 <= found.rank_low <= found.rank_high
        assert found.is_with_best == (found.rank_low == 1)
    compare(sent, errors, truth.manifest.recording_index)


def compare(sent: dict[str, Submission], errors: dict[str, np.ndarray], recordings: np.ndarray) -> None:
    """All pairs through the server; their p against scipy's test of the same recordings."""
    split = Split.objects.select_related("published_edition__ground_truth").get(pk="test")

    def ask() -> comparisons.Compared:
        ids = [submission.method_id for submission in sent.values()]
        return comparisons.of(methods=ids, split=split, viewer=ANYBODY, now=timezone.now())

    assert not ask().is_complete
    builders.infer_all()
    answer = ask()
    assert answer.is_complete
    assert len(answer.pairs) == 6
    for pair in answer.pairs:
        gaps = np.bincount(recordings, weights=errors[pair.first.method] - errors[pair.second.method])
        assert pair.differences is not None
        assert list(pair.differences) == list(SCORE_NAMES)
        found = pair.differences["mid"]
        assert found.difference == published(pair.first.scores["mid"] - pair.second.scores["mid"])
        assert found.low <= found.difference <= found.high
        assert found.p == pytest.approx(permutation_p(gaps, n_resamples=1_999), abs=0.04)
