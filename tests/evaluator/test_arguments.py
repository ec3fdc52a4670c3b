"""Files in any form, short names of things, and errors that say what was expected."""

import io
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import evaluator
from evaluator import (
    GroundTruth,
    Manifest,
    Predictions,
    Rejected,
    evaluate,
    read_manifest,
    read_predictions,
    read_truth,
)
from tests.evaluator.worlds import EXAMPLES, REPOSITORY, make_truth

FILE = EXAMPLES / "predictions.json"
TABLE = EXAMPLES / "truth.csv"


@pytest.fixture(scope="module")
def truth() -> GroundTruth:
    return read_truth(TABLE)


def forms(path: Path) -> list[object]:
    data = path.read_bytes()
    return [str(path), path, data, bytearray(data), io.BytesIO(data), io.StringIO(data.decode())]


def test_every_reader_takes_paths_bytes_and_open_files(truth: GroundTruth) -> None:
    expected = read_predictions(FILE.read_bytes(), manifest=truth.manifest)
    for source in forms(FILE):
        found = read_predictions(source, manifest=truth.manifest)
        assert (found.digest, found.ttc_s.tolist()) == (expected.digest, expected.ttc_s.tolist())
    assert {read_truth(source).digest for source in forms(TABLE)} == {truth.digest}
    assert {read_manifest(source).digest for source in forms(TABLE)} == {truth.manifest.digest}
    assert {evaluator.convert(source, to="ttc") for source in forms(FILE)} == {evaluator.convert(FILE)}


def test_predictions_are_written_to_an_open_file_as_well(truth: GroundTruth) -> None:
    kept = io.BytesIO()
    data = evaluator.write_predictions(kept, manifest=truth.manifest, ttc_s=truth.ttc_s)
    assert kept.getvalue() == data


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda t: evaluate(t.ttc_s, t),
            "predictions is of type numpy.ndarray; expected Predictions: read",
        ),
        (lambda t: evaluate(FILE, t), "predictions is of type pathlib.PosixPath; expected Predictions"),
        (lambda t: evaluate(None, t), "predictions is None; expected Predictions"),
        (
            lambda t: evaluate(read_predictions(FILE, manifest=t.manifest), TABLE),
            r"truth is of type pathlib.PosixPath; expected GroundTruth: read_truth\(file\)",
        ),
        (lambda t: read_predictions(FILE, manifest=t), "manifest is of type GroundTruth; expected Manifest"),
        (
            lambda t: read_predictions({"0": 1.0}, manifest=t.manifest),
            "source is of type dict; expected",
        ),
        (lambda t: read_predictions('{"0": 1}', manifest=t.manifest), "source is JSON text; .*text.encode"),
        (read_truth, "source is of type GroundTruth; expected a path"),
    ],
)
def test_the_wrong_thing_is_a_type_error_that_says_what_was_expected(
    truth: GroundTruth, call: object, words: str
) -> None:
    with pytest.raises(TypeError, match=words):
        call(truth)


def test_a_file_that_is_not_there_is_named(truth: GroundTruth, tmp_path: Path) -> None:
    for read in (lambda path: read_predictions(path, manifest=truth.manifest), read_truth, read_manifest):
        with pytest.raises(Rejected) as caught:
            read(tmp_path / "mine.json")
        found = str(caught.value.problems[0])
        assert found == "mine.json: The file cannot be read: No such file or directory."


def test_arrays_may_be_scale_ratios(truth: GroundTruth) -> None:
    ratios = evaluator.ttc_to_scale_ratio(truth.ttc_s, fps_hz=2)
    data = evaluator.write_predictions(manifest=truth.manifest, scale_ratio=ratios, frame_gap=5)
    expected = read_predictions(data, manifest=truth.manifest).ttc_s
    for rate in ({"frame_gap": 5}, {"fps_hz": 2}):
        found = Predictions.from_arrays(scale_ratio=ratios, manifest=truth.manifest, **rate)
        assert (found.unit, found.ttc_s.tolist()) == ("scale_ratio", expected.tolist())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({}, "either ttc_s or scale_ratio"),
        ({"ttc_s": [1.0], "scale_ratio": [1.0]}, "either ttc_s or scale_ratio"),
        ({"scale_ratio": [1.0]}, "Scale ratios need either fps_hz or frame_gap"),
        ({"scale_ratio": [1.0], "frame_gap": 6}, "frame_gap is 6; expected 1 to 5"),
        ({"ttc_s": [1.0], "frame_gap": 5}, "Times to contact have no rate"),
        ({"scale_ratio": [1.0, 2.0], "frame_gap": 5}, r"scale_ratio has the shape \(2,\); expected \(1,\)"),
    ],
)
def test_arrays_that_do_not_fit_together_are_refused(arguments: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Predictions.from_arrays(manifest=make_truth([4.0]).manifest, **arguments)


def test_a_scale_ratio_of_nothing_is_named() -> None:
    with pytest.raises(Rejected) as caught:
        Predictions.from_arrays(scale_ratio=[0.9, 0.0], frame_gap=1, manifest=make_truth([4.0, 5.0]).manifest)
    assert [problem.code for problem in caught.value.problems] == ["not-positive"]


def test_things_are_short_in_a_notebook() -> None:
    truth = make_truth(np.linspace(0.5, 25, 5_000))
    predictions = Predictions.from_arrays(ttc_s=truth.ttc_s, manifest=truth.manifest)
    for thing in (truth, truth.manifest, predictions, truth.objects, evaluate(predictions, truth)):
        assert len(repr(thing)) < 120
    assert repr(truth).startswith("GroundTruth(5,000 sequences, 0.5 to 25 s, sha256:")
    assert isinstance(truth.manifest, Manifest)


WITHOUT_THE_COMMAND = """
import sys
for name in ("click", "cryptography", "jwt", "httpx", "keyring", "rich", "pandas", "matplotlib"):
    sys.modules[name] = None
import evaluator
truth = evaluator.read_truth("truth.csv")
predictions = evaluator.read_predictions("predictions.json", manifest=truth.manifest)
report = evaluator.evaluate(predictions, truth, keep_sequences=True)
evaluator.confidence_intervals(predictions, truth)
report.breakdown("range")
evaluator.write_predictions(manifest=truth.manifest, ttc_s=truth.ttc_s)
print(report)
"""


def test_the_library_scores_without_what_the_command_needs() -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_THE_COMMAND],
        capture_output=True,
        text=True,
        check=False,
        cwd=EXAMPLES,
        env={"PYTHONPATH": str(REPOSITORY), "PYTHONIOENCODING": "utf-8"},
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("TTC range")
