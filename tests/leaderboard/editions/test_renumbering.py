"""Corrections that renumber sequences, drop some or add some: a file keeps the meaning that it was sent with.

The reference is the evaluator alone, given each file's values by natural key.
"""

import json
import random
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from evaluator import Manifest, evaluate, read_manifest, read_predictions, read_truth, rounded
from evaluator.scoring.report import Report
from leaderboard.boards.rows import flat_scores
from leaderboard.editions import preview
from leaderboard.models import Edition, Evaluation, Status, Submission, User
from leaderboard.statistics import recording_sums
from leaderboard.storage import files
from tests import builders
from tests.editions import open_edition, publish, roll_back

HEAD = "anno_id,bag_stamp,cam_id,ts,track_id,ttc"
Row = list[str]
ValuesByKey = dict[str, float]  # natural key to seconds


def rows_of(path: Path) -> list[Row]:
    return [line.split(",")[1:] for line in path.read_text().splitlines()[1:]]


def numbered(path: Path, rows: list[Row]) -> Path:
    """A ground truth with these rows, numbered as they stand."""
    lines = [HEAD, *(",".join([str(i), *row]) for i, row in enumerate(rows))]
    path.write_text("\n".join(lines) + "\n")
    return path


def permuted(folder: Path) -> Path:
    """The same sequences and values with the anno_ids in another order."""
    rows = rows_of(folder / "truth-test.csv")
    random.Random(1).shuffle(rows)
    return numbered(folder / "permuted.csv", rows)


def dropped(folder: Path) -> Path:
    """Without two recordings; everything behind them has another anno_id."""
    rows = [row for row in rows_of(folder / "truth-test.csv") if row[0] not in {"0001", "0007"}]
    return numbered(folder / "dropped.csv", rows)


def inserted(folder: Path) -> Path:
    """With three sequences more in front; everything behind them has another anno_id."""
    new = [["0000", "9", str(700_000_000 + i), "5", f"{2.0 + i}"] for i in range(3)]
    return numbered(folder / "inserted.csv", [*new, *rows_of(folder / "truth-test.csv")])


def values_by_key(data: bytes, manifest: Manifest) -> ValuesByKey:
    """The value of each sequence in the file, read with this manifest."""
    values = read_predictions(data, manifest=manifest).ttc_s.tolist()
    return dict(zip(manifest.natural_keys, values, strict=True))


def report(values: ValuesByKey, path: Path) -> Report:
    """The report of the evaluator alone on these values, from a file with natural keys."""
    truth = read_truth(path)
    file = json.dumps({key: values[key] for key in truth.manifest.natural_keys}).encode()
    return evaluate(read_predictions(file, manifest=truth.manifest), truth, keep_bags=True)


def offline(values: ValuesByKey, path: Path) -> dict[str, float | None]:
    return {name: rounded(value, decimals=1) for name, value in report(values, path).flat().items()}


def scores(submission: Submission, edition: Edition) -> Mapping[str, float | None]:
    evaluation = submission.evaluations.get(edition=edition)
    assert evaluation.status == Status.SCORED, evaluation.problems
    return flat_scores(evaluation)


def first() -> Edition:
    return Edition.objects.get(number=1)


@pytest.fixture
def sent(edition: Edition, owner: User, tmp_path: Path) -> dict[Submission, ValuesByKey]:
    """Two scored files, and what each says: scale ratios by anno_id, seconds by natural key."""
    truth = read_truth(tmp_path / "truth-test.csv")
    manifest, rng = truth.manifest, np.random.default_rng(0)
    ttc_s = truth.ttc_s * np.exp(rng.normal(0, 0.3, (2, truth.n_sequences)))
    ratios = 1.0 / (1.0 + 1.0 / (10.0 * ttc_s[0]))
    by_id = dict(zip(manifest.anno_id_keys, ratios.tolist(), strict=True))
    by_key = dict(zip(manifest.natural_keys, ttc_s[1].tolist(), strict=True))
    data = [
        json.dumps(content).encode()
        for content in ({"unit": "scale_ratio", "fps": 10, "predictions": by_id}, by_key)
    ]
    made = {
        builders.submit(owner, each, method=f"Method {i}"): values_by_key(each, manifest)
        for i, each in enumerate(data)
    }
    builders.score_all()
    return made


def forget_kept_values(sent: dict[Submission, ValuesByKey]) -> None:
    for submission in sent:
        manifest, digest = submission.manifest_digest, submission.digest
        files.store().delete(files.aligned_name(manifest_digest=manifest, digest=digest))


@pytest.mark.slow
@pytest.mark.parametrize("way", ["from kept values", "from the files"])
def test_scores_change_exactly_as_an_offline_score_by_natural_keys_says(
    sent: dict[Submission, ValuesByKey], tmp_path: Path, way: str
) -> None:
    editions = {change: open_edition(change(tmp_path)) for change in (permuted, dropped, inserted)}
    if way == "from the files":
        forget_kept_values(sent)
    builders.score_all()
    for submission, values in sent.items():
        assert scores(submission, editions[permuted]) == scores(submission, first())
        assert scores(submission, editions[permuted]) == offline(values, tmp_path / "permuted.csv")
        assert scores(submission, editions[dropped]) == offline(values, tmp_path / "dropped.csv")
        assert scores(submission, editions[dropped]) != scores(submission, first())
        # Another numbering is no other truth: neither are the sums, of which intervals are made.
        before, after = (
            recording_sums.sums_of(each, file=submission.sent_file) for each in (first(), editions[permuted])
        )
        assert after == pytest.approx(before, rel=1e-12)
    for evaluation in Evaluation.objects.filter(edition=editions[inserted]):
        assert (evaluation.status, evaluation.n_problems) == (Status.REJECTED, 3)
        [problem] = evaluation.problems
        assert (problem["code"], problem["where"]) == ("missing-keys", "/0000~19~1700000000~15")
        assert problem["message"].startswith(
            "3 sequences have no value, added by a correction after the file was sent: "
            '"0000/9/700000000/5", "0000/9/700000001/5", "0000/9/700000002/5"; expected a new file'
        )
    truth = preview.preview(editions[inserted]).truth
    assert truth is not None
    assert (truth.n_added, truth.n_removed, truth.n_changed, truth.n_renumbered) == (3, 0, 0, 120)


@pytest.mark.slow
def test_the_same_bytes_for_two_manifests_are_two_submissions_that_are_never_mixed_up(
    sent: dict[Submission, ValuesByKey], owner: User, tmp_path: Path
) -> None:
    path = permuted(tmp_path)
    second = open_edition(path)
    [old, *_] = sent
    with files.opened_predictions(old.digest) as kept:
        data = kept.read()
    assert builders.submit(owner, data, method="Method 0") == old
    builders.score_all()
    publish(second)
    new = builders.submit(owner, data, method="Method 0")
    assert new != old
    assert builders.submit(owner, data, method="Method 0") == new
    builders.score_all()
    meant = {old: sent[old], new: values_by_key(data, read_manifest(path))}
    roll_back()
    builders.score_all()
    for submission, values in meant.items():
        assert scores(submission, second) == offline(values, path)
        assert scores(submission, first()) == offline(values, tmp_path / "truth-test.csv")
        expected = report(values, path).bags
        assert expected is not None
        assert recording_sums.sums_of(second, file=submission.sent_file) == pytest.approx(expected.sums)
    assert scores(old, second) != scores(new, second)


def test_a_file_for_the_corrected_manifest_is_scored_in_the_former_edition_too(
    sent: dict[Submission, ValuesByKey], owner: User, tmp_path: Path
) -> None:
    path = inserted(tmp_path)
    second = open_edition(path)
    builders.score_all()
    publish(second, leave_out=True)
    truth = read_truth(path)
    values = dict(zip(truth.manifest.anno_id_keys, (truth.ttc_s * 1.2).tolist(), strict=True))
    late = builders.submit(owner, json.dumps(values).encode(), method="Late")
    builders.score_all()
    roll_back()
    builders.score_all()
    natural_values = values_by_key(json.dumps(values).encode(), truth.manifest)
    assert scores(late, second) == offline(natural_values, path)
    assert scores(late, first()) == offline(natural_values, tmp_path / "truth-test.csv")


def test_a_damaged_manifest_is_our_fault_and_not_the_files(
    benchmark: None, owner: User, tmp_path: Path
) -> None:
    edition = builders.import_truth(tmp_path, seed=9)  # of its own: workers remember manifests
    old = builders.submit(owner, builders.predictions(edition))
    builders.score_all()
    stored = Path(files.store().path(files.manifest_name(old.manifest_digest)))
    stored.write_bytes(stored.read_bytes().replace(b"0001,1,", b"0001,2,", 1))
    second = open_edition(permuted(tmp_path))
    builders.score_all()
    row = old.evaluations.get(edition=second)
    assert (row.status, row.n_infrastructure_strikes, row.problems) == (Status.QUEUED, 1, [])
    assert "has another content" in row.last_error
