"""Files written from arrays are valid and read back exactly."""

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluator import Manifest, Rejected, read_predictions, write_predictions
from evaluator.metrics.scale import scale_ratio_to_ttc
from evaluator.predictions.writing import template
from tests.evaluator.worlds import make_truth

MANIFEST = make_truth([4.0, -10.0, 1.0], anno_ids=[7, 0, 12]).manifest
TTC_S = [5.31, -12.9, 0.84]


def read(data: bytes, manifest: Manifest = MANIFEST) -> list[float]:
    return list(read_predictions(data, manifest=manifest).ttc_s.tolist())


def test_a_manifest_gives_a_file_natural_keys() -> None:
    data = write_predictions(manifest=MANIFEST, ttc_s=np.array(TTC_S))
    assert json.loads(data) == dict(zip(MANIFEST.natural_keys, TTC_S, strict=True))
    assert write_predictions(manifest=MANIFEST, ttc_s=TTC_S, keys="natural_key") == data
    assert read(data) == TTC_S


def test_a_file_of_the_first_edition_says_the_same_of_a_renumbered_one() -> None:
    data = write_predictions(manifest=MANIFEST, ttc_s=TTC_S)
    table = MANIFEST.to_table()
    table.anno_id = [0, 12, 7]
    renumbered = Manifest.from_table(table)
    assert read(data, renumbered) == TTC_S
    by_number = write_predictions(manifest=MANIFEST, ttc_s=TTC_S, keys="anno_id")
    assert read(by_number, renumbered) != TTC_S


def test_the_toolkits_form_is_written_if_it_is_asked_for() -> None:
    data = write_predictions(manifest=MANIFEST, ttc_s=np.array(TTC_S), keys="anno_id")
    assert json.loads(data) == {"7": 5.31, "0": -12.9, "12": 0.84}
    assert read(data) == TTC_S


def test_the_template_has_natural_keys() -> None:
    assert json.loads(template(MANIFEST)) == dict.fromkeys(MANIFEST.natural_keys)


@pytest.mark.parametrize("rate", [{"fps_hz": 2.5}, {"frame_gap": 4}])
def test_scale_ratios_are_written_with_their_rate(rate: dict[str, Any]) -> None:
    ratios = [0.9, 1.25, 1.0]
    data = write_predictions(manifest=MANIFEST, scale_ratio=ratios, **rate)
    assert read(data) == scale_ratio_to_ttc(ratios, fps_hz=2.5).tolist()


@pytest.mark.parametrize("keys", [MANIFEST.natural_keys, [7, 0, 12], ["7", "0", "12"]])
def test_keys_may_be_given_instead_of_a_manifest(keys: list[str | int]) -> None:
    assert read(write_predictions(keys=keys, ttc_s=TTC_S)) == TTC_S


@pytest.mark.slow
@given(values=st.lists(st.floats(allow_nan=False).filter(bool), min_size=1, max_size=30))
def test_every_value_reads_back_exactly(values: list[float]) -> None:
    manifest = make_truth([4.0] * len(values)).manifest
    assert read(write_predictions(manifest=manifest, ttc_s=values), manifest) == values
    assert read(write_predictions(keys=manifest.natural_keys, ttc_s=values, meta={}), manifest) == values


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (
            {"ttc_s": [1.0, math.nan, 1.0]},
            "nan",
            'The value of "0" is nan; expected a number of seconds.',
        ),
        (
            {"ttc_s": [1.0, -0.0, 1.0]},
            "zero",
            'The value of "0" is -0.0; expected a time to contact other than 0, negative when moving away.',
        ),
        (
            {"scale_ratio": [1.0, 0.0, 1.0], "fps_hz": 2},
            "not-positive",
            'The value of "0" is 0.0; expected a scale ratio greater than 0.',
        ),
        (
            {"scale_ratio": [1.0, math.nan, 1.0], "fps_hz": 2},
            "nan",
            'The value of "0" is nan; expected a scale ratio greater than 0.',
        ),
    ],
)
def test_values_that_no_file_may_hold_are_refused(arguments: dict[str, Any], code: str, message: str) -> None:
    with pytest.raises(Rejected) as rejected:
        write_predictions(manifest=MANIFEST, keys="anno_id", **arguments)
    assert [(p.code, p.message, p.where) for p in rejected.value.problems] == [(code, message, "/0")]


def test_notes_that_no_file_may_hold_are_refused() -> None:
    with pytest.raises(Rejected) as rejected:
        write_predictions(manifest=MANIFEST, ttc_s=TTC_S, meta={"loss": math.nan})
    assert [problem.code for problem in rejected.value.problems] == ["bad-meta"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "Give either ttc_s or scale_ratio"),
        ({"ttc_s": TTC_S, "scale_ratio": TTC_S}, "Give either ttc_s or scale_ratio"),
        ({"ttc_s": TTC_S, "keys": ["0", "1", "2"]}, "Give either manifest or keys"),
        ({"ttc_s": TTC_S, "manifest": None}, "Give either manifest or keys"),
        ({"ttc_s": TTC_S, "keys": "natural"}, 'keys is "natural"; expected "natural_key" or "anno_id"'),
        ({"ttc_s": TTC_S, "manifest": None, "keys": "anno_id"}, "with a manifest"),
        ({"ttc_s": [1.0]}, "Found 1 value for 3 sequences"),
        ({"ttc_s": [TTC_S]}, r"shape \(1, 3\); expected \(n,\)"),
        ({"ttc_s": TTC_S, "manifest": None, "keys": ["0", "0", "1"]}, "not distinct"),
        ({"ttc_s": TTC_S, "fps_hz": 2}, "no rate"),
        ({"ttc_s": TTC_S, "frame_gap": 5, "meta": {}}, "no rate"),
        ({"scale_ratio": TTC_S}, "either fps_hz or frame_gap"),
        ({"scale_ratio": TTC_S, "fps_hz": 2, "frame_gap": 5}, "either fps_hz or frame_gap"),
        ({"scale_ratio": TTC_S, "fps_hz": 0}, "fps_hz is 0; expected"),
        ({"scale_ratio": TTC_S, "fps_hz": math.inf}, "fps_hz is inf; expected"),
        ({"scale_ratio": TTC_S, "frame_gap": 6}, "frame_gap is 6; expected 1 to 5"),
    ],
)
def test_arguments_that_do_not_fit_together_are_errors_of_the_caller(
    arguments: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        write_predictions(**({"manifest": MANIFEST} | arguments))
