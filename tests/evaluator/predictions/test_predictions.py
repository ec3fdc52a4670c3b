"""What a prediction file may contain, and which predictions it means."""

import json
import math
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from evaluator import Manifest, Predictions, read_predictions
from evaluator.metrics.scale import fps_of_gap, scale_ratio_to_ttc
from evaluator.predictions.loading import sha256_digest
from tests.evaluator.worlds import envelope, flat, make_truth

TTC_S = [5.31, -12.9, 0.4, 100.0]


@pytest.fixture(scope="module")
def manifest() -> Manifest:
    return make_truth([4.0, -10.0, 1.0, 18.0]).manifest


def read(data: bytes, manifest: Manifest) -> list[float]:
    ttc_s = read_predictions(data, manifest=manifest).ttc_s
    assert ttc_s.dtype == np.float64
    return list(ttc_s.tolist())


def test_natural_keys_name_the_target_frame(manifest: Manifest) -> None:
    assert manifest.natural_keys[1] == "0000/1/600000000/1"
    members = dict(zip(manifest.natural_keys, TTC_S, strict=True))
    for data in (flat(members), envelope(members, unit="ttc")):
        predictions = read_predictions(data, manifest=manifest)
        assert predictions.ttc_s.tolist() == TTC_S
        assert predictions.keys == "natural_key"


@pytest.mark.parametrize("field", [{"fps": 2}, {"fps": 2.0}, {"frame_gap": 5}, {"frame_gap": 5.0}])
def test_scale_ratios_become_seconds_at_their_rate(manifest: Manifest, field: dict[str, float]) -> None:
    data = envelope({"0": 0.8, "1": 1.25, "2": 1.0, "3": 0.5}, unit="scale_ratio", **field)
    expected = [2.0, float(scale_ratio_to_ttc(1.25, fps_hz=2)), math.inf, 0.5]
    predictions = read_predictions(data, manifest=manifest)
    assert predictions.ttc_s.tolist() == expected
    assert predictions.unit == "scale_ratio"


def test_each_key_may_have_its_own_rate(manifest: Manifest) -> None:
    ratios, gaps = [0.9, 1.1, 0.95, 0.8], [1, 2, 4, 5]
    expected = [float(scale_ratio_to_ttc(r, fps_hz=fps_of_gap(g))) for r, g in zip(ratios, gaps, strict=True)]
    by_row = dict(enumerate(ratios))
    data = envelope(by_row, unit="scale_ratio", frame_gap=dict(reversed(list(enumerate(gaps)))))
    assert read(data, manifest) == expected
    natural = dict(zip(manifest.natural_keys, [10 / g for g in gaps], strict=True))
    assert read(envelope(by_row, unit="scale_ratio", fps=natural), manifest) == expected


def test_meta_is_kept_and_not_scored(manifest: Manifest) -> None:
    meta = {"model": "Foo++", "epochs": 12, "notes": ["ünïcode", None, True, {"nested": 0.5}]}
    data = envelope(dict(enumerate(TTC_S)), unit="ttc", meta=meta)
    predictions = read_predictions(data, manifest=manifest)
    assert predictions.meta == meta
    assert predictions.ttc_s.tolist() == TTC_S


def test_a_byte_order_mark_is_tolerated(manifest: Manifest) -> None:
    assert read(b"\xef\xbb\xbf" + flat(TTC_S), manifest) == TTC_S


def test_infinities_are_accepted_as_python_writes_them(manifest: Manifest) -> None:
    assert read(flat([math.inf, -math.inf, 1.0, 2.0]), manifest) == [math.inf, -math.inf, 1.0, 2.0]


@pytest.mark.parametrize(
    ("literal", "value"),
    [
        (b"7", 7.0),
        (b"-7", -7.0),
        (b"7E+1", 70.0),
        (b"700e-2", 7.0),
        (b"1e400", math.inf),
        (b"-1e400", -math.inf),
        (b"9" * 400, math.inf),
        (b"-" + b"9" * 5000, -math.inf),
        (b"9007199254740993", 9007199254740992.0),
        (b"123456789012345678901234567890", 123456789012345678901234567890.0),
        (b"0.1000000000000000055511151231257827021181583404541015625", 0.1),
        (b"2.2250738585072011e-308", 2.2250738585072011e-308),
        (b"5e-324", 5e-324),
        (b"1.7976931348623158e308", sys.float_info.max),
    ],
)
def test_number_literals_mean_the_nearest_float64(manifest: Manifest, literal: bytes, value: float) -> None:
    assert read(b'{"0": %b, "1": 1, "2": 2.5, "3": 3}' % literal, manifest) == [value, 1.0, 2.5, 3.0]


def test_the_digest_is_that_of_the_files_bytes(manifest: Manifest) -> None:
    data = flat(TTC_S)
    assert read_predictions(data, manifest=manifest).digest == sha256_digest(data)
    assert read_predictions(data + b"\n", manifest=manifest).digest != sha256_digest(data)


def test_arrays_make_predictions_without_a_file(manifest: Manifest) -> None:
    values = np.array(TTC_S, dtype=np.float32)
    predictions = Predictions.from_arrays(ttc_s=values, manifest=manifest)
    assert predictions.ttc_s.tolist() == values.astype(np.float64).tolist()
    assert predictions.digest == sha256_digest(values.astype("<f8").tobytes())
    assert Predictions.from_arrays(ttc_s=values, manifest=manifest, digest="sha256:0").digest == "sha256:0"
    values[0] = 1.0
    assert predictions.ttc_s[0] != 1.0


@pytest.mark.parametrize("name", ["flat", "envelope", "natural"])
def test_a_position_in_the_file_is_a_json_pointer(manifest: Manifest, name: str, tmp_path: Path) -> None:
    members = (
        dict(zip(manifest.natural_keys, TTC_S, strict=True)) if name == "natural" else dict(enumerate(TTC_S))
    )
    data = envelope(members, unit="ttc") if name == "envelope" else flat(json.loads(json.dumps(members)))
    expected = {"flat": "/1", "envelope": "/predictions/1", "natural": "/0000~11~1600000000~11"}
    assert read_predictions(data, manifest=manifest).where(1) == expected[name]


@pytest.mark.parametrize("natural", [False, True])
def test_a_file_is_read_in_at_most_ten_times_its_size(natural: bool) -> None:
    manifest = make_truth([4.0] * 5_000).manifest
    keys = manifest.natural_keys if natural else manifest.anno_id_keys
    data = flat(dict(zip(keys, np.random.default_rng(1).normal(0, 10, len(keys)).tolist(), strict=True)))
    tracemalloc.start()
    try:
        read_predictions(data, manifest=manifest)
        _, peak_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak_bytes < 10 * len(data)
