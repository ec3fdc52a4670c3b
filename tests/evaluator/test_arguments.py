"""Files in any form, short names of things, and errors that say what was expected."""

import io
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import evaluator
from evaluator import (
    GroundTruth,
    Predictions,
    Rejected,
    evaluate,
    read_manifest,
    read_predictions,
    read_truth,
)
from evaluator.frames import manifest_frame
from evaluator.metrics.registry import MID
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
        predictions = read_predictions(source, manifest=truth.manifest)
        assert (predictions.digest, predictions.ttc_s.tolist()) == (expected.digest, expected.ttc_s.tolist())
    assert {read_truth(source).digest for source in forms(TABLE)} == {truth.digest}
    assert {read_manifest(source).digest for source in forms(TABLE)} == {truth.manifest.digest}
    assert {evaluator.convert(source, to="ttc") for source in forms(FILE)} == {evaluator.convert(FILE)}


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
        message = str(caught.value.problems[0])
        assert message == "mine.json: The file cannot be read: No such file or directory."


def test_arrays_may_be_scale_ratios(truth: GroundTruth) -> None:
    ratios = evaluator.ttc_to_scale_ratio(truth.ttc_s, fps_hz=2)
    data = evaluator.write_predictions(manifest=truth.manifest, scale_ratio=ratios, frame_gap=5)
    expected = read_predictions(data, manifest=truth.manifest).ttc_s
    for rate in ({"frame_gap": 5}, {"fps_hz": 2}):
        predictions = Predictions.from_arrays(scale_ratio=ratios, manifest=truth.manifest, **rate)
        assert (predictions.unit, predictions.ttc_s.tolist()) == ("scale_ratio", expected.tolist())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({}, "either ttc_s or scale_ratio"),
        ({"ttc_s": [1.0], "scale_ratio": [1.0]}, "either ttc_s or scale_ratio"),
        ({"scale_ratio": [1.0]}, "Scale ratios need either fps_hz or frame_gap"),
        ({"scale_ratio": [1.0], "frame_gap": 6}, "frame_gap is 6; expected 1 to 5"),
        ({"ttc_s": [1.0], "frame_gap": 5}, "Times to contact have no rate"),
        (
            {"scale_ratio": [1.0], "fps_hz": [5, 5]},
            "fps_hz has 2 values; expected one number for all sequences",
        ),
        ({"scale_ratio": [1.0, 2.0], "frame_gap": 5}, r"scale_ratio has the shape \(2,\); expected \(1,\)"),
    ],
)
def test_arrays_that_do_not_fit_together_are_refused(arguments: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Predictions.from_arrays(manifest=make_truth([4.0]).manifest, **arguments)


def shuffled(truth: GroundTruth) -> pd.Series:
    """The true values as a Series whose rows are in another order than the manifest's."""
    return pd.Series(truth.ttc_s).sample(frac=1, random_state=1)


SERIES = (
    r"ttc_s is a Series with the index \d+, \d+, \d+, …; expected 0, 1, 2, …, one row for each sequence in "
    r"the manifest's order, because values are taken by their place\. Sort it and give ttc_s\.to_numpy\(\), "
    r"or give a frame with anno_id to evaluator\.frames\.predictions_from_frame\."
)


def test_a_series_in_another_order_is_not_taken_by_position(truth: GroundTruth) -> None:
    values = shuffled(truth)
    with pytest.raises(ValueError, match=SERIES):
        Predictions.from_arrays(ttc_s=values, manifest=truth.manifest)
    with pytest.raises(ValueError, match=SERIES):
        evaluator.write_predictions(ttc_s=values, manifest=truth.manifest)
    with pytest.raises(ValueError, match="scale_ratio is a Series with the index"):
        Predictions.from_arrays(scale_ratio=values, frame_gap=5, manifest=truth.manifest)
    for given in (values.sort_index(), values.to_numpy()[values.index.argsort()]):
        predictions = Predictions.from_arrays(ttc_s=given, manifest=truth.manifest)
        assert predictions.ttc_s.tolist() == truth.ttc_s.tolist()


def test_a_series_may_be_indexed_by_the_manifest_s_own_anno_ids_alone() -> None:
    truth = make_truth([4.0, 5.0, 6.0], anno_ids=[2, 0, 1])
    own = pd.Series(truth.ttc_s, index=manifest_frame(truth.manifest).index)
    predictions = Predictions.from_arrays(ttc_s=own, manifest=truth.manifest)
    assert predictions.ttc_s.tolist() == [4.0, 5.0, 6.0]
    with pytest.raises(ValueError, match="with the index 0, 1, 2; expected 2, 0, 1"):
        Predictions.from_arrays(ttc_s=own.sort_index(), manifest=truth.manifest)


class FakeTensor:
    """What torch's tensors do with bfloat16 and with a gradient: `numpy` takes neither."""

    def __init__(self, values: object, *, state: str = "bfloat16, grad, device") -> None:
        self.values, self.state = np.asarray(values, dtype=np.float64), state

    def __array__(self, dtype: object = None, copy: object = None) -> np.ndarray:
        if self.state:
            raise TypeError(f"Got unsupported {self.state}")
        return self.values

    def detach(self) -> "FakeTensor":
        return FakeTensor(self.values, state=self.state.replace(", grad", ""))

    def cpu(self) -> "FakeTensor":
        return FakeTensor(self.values, state=self.state.replace(", device", ""))

    def double(self) -> "FakeTensor":
        assert "device" not in self.state, "not every device has float64"
        return FakeTensor(self.values, state=self.state.replace("bfloat16", ""))


def tensor_kinds() -> list[object]:
    """Makers of tensors, those of torch included where it is installed."""
    if find_spec("torch") is None:
        return [FakeTensor]
    import torch  # noqa: PLC0415 -- of an extra

    kinds = ({"requires_grad": True}, {"dtype": torch.bfloat16}, {"dtype": torch.float16})
    return [FakeTensor, *(partial(torch.tensor, **kind) for kind in kinds)]


@pytest.mark.parametrize("tensor", tensor_kinds())
def test_tensors_are_taken_in_bfloat16_and_with_a_gradient(tensor: Callable[[object], object]) -> None:
    manifest, values = make_truth([4.0, 5.0]).manifest, [0.5, 0.75]  # exact in bfloat16
    ttc_s = [1.0 / (2 * (1 / value - 1)) for value in values]
    for given in (tensor(values), [tensor(value) for value in values]):
        assert Predictions.from_arrays(ttc_s=given, manifest=manifest).ttc_s.tolist() == values
        predictions = Predictions.from_arrays(scale_ratio=given, frame_gap=5, manifest=manifest)
        assert predictions.ttc_s.tolist() == ttc_s
        assert evaluator.write_predictions(ttc_s=given, manifest=manifest, keys="anno_id") == (
            b'{"0":0.5,"1":0.75}'
        )
        assert evaluator.scale_ratio_to_ttc(given, fps_hz=2).tolist() == ttc_s
        assert evaluator.ttc_to_scale_ratio([4.0, 8.0], fps_hz=given).shape == (2,)
        assert evaluator.convert_rate(given, from_fps_hz=2, to_fps_hz=2).tolist() == values
        assert MID.errors(given, given).shape == (2,)


def test_the_refusal_of_a_dict_names_the_call_that_takes_one(truth: GroundTruth) -> None:
    values = dict(zip(truth.manifest.anno_id_keys, truth.ttc_s.tolist(), strict=True))
    words = (
        r"ttc_s is of type dict; expected one number for each sequence, in the manifest's order\. For values "
        r"by key, give write_predictions keys=list\(d\) and ttc_s=list\(d\.values\(\)\), and its bytes to "
        r"read_predictions\."
    )
    with pytest.raises(TypeError, match=words):
        Predictions.from_arrays(ttc_s=values, manifest=truth.manifest)
    data = evaluator.write_predictions(keys=list(values), ttc_s=list(values.values()))
    assert read_predictions(data, manifest=truth.manifest).ttc_s.tolist() == truth.ttc_s.tolist()


WITHOUT_THE_COMMAND = """
import sys
for name in ("click", "cryptography", "jwt", "httpx2", "keyring", "rich", "pandas", "matplotlib"):
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


@pytest.mark.slow
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
