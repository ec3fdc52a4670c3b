"""Tables that say two things are refused, wherever they are read."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from evaluator import (
    Predictions,
    Rejected,
    manifest_frame,
    predictions_from_frame,
    read_manifest,
    read_predictions,
    read_truth,
    write_predictions,
)
from evaluator.arrays import whole_numbers
from evaluator.metrics.scale import scale_ratio_to_ttc
from tests.evaluator.worlds import EXAMPLES, Tsttc, make_truth
from tsttc_baselines.annotation.tracks import COLUMNS as TRACK_COLUMNS
from tsttc_baselines.annotation.tracks import read_tracks
from tsttc_baselines.box_tables import read_boxes

TRUTH = make_truth([4.0, -10.0, 1.0])
MANIFEST = TRUTH.manifest


def problem(read: Callable[[], object]) -> tuple[str, str]:
    with pytest.raises(Rejected) as rejected:
        read()
    [only] = rejected.value.problems
    return only.code, only.message


def doubled(text: str, name: str) -> str:
    """The table with a second column of this name."""
    head, *rows = text.splitlines()
    return "\n".join([f"{head},{name}", *(f"{row},{number}" for number, row in enumerate(rows, 7))]) + "\n"


PREDICTIONS = "anno_id,ttc\n0,4\n1,-10\n2,1\n"
RATIOS = "anno_id,scale_ratio,fps\n0,0.9,2\n1,1.1,2\n2,0.8,2\n"


@pytest.mark.parametrize(
    ("table", "name"),
    [(PREDICTIONS, "ttc"), (PREDICTIONS, "anno_id"), (RATIOS, "scale_ratio"), (RATIOS, "fps")],
)
def test_two_columns_of_one_name_are_no_predictions(table: str, name: str) -> None:
    data = doubled(table, name).encode()
    expected = ("bad-field", f'The table has 2 columns "{name}"; expected one.')
    assert problem(lambda: read_predictions(data, manifest=MANIFEST)) == expected
    assert len(read_predictions(doubled(table, "note").encode(), manifest=MANIFEST).ttc_s) == 3


@pytest.mark.parametrize("name", ["ttc", "anno_id", "bag_stamp", "ts", "unit", "occ_ratio"])
def test_two_columns_of_one_name_are_no_ground_truth(name: str) -> None:
    text = TRUTH.to_csv().decode()
    if name not in text.splitlines()[0]:
        text = doubled(text, name)
    data = doubled(text, name).encode()
    expected = ("bad-field", f'The table has 2 columns "{name}"; expected one.')
    assert problem(lambda: read_truth(data)) == expected
    if name not in {"ttc", "occ_ratio"}:
        assert problem(lambda: read_manifest(data)) == expected


def test_two_columns_of_one_name_are_no_boxes_and_no_tracks(tmp_path: Path) -> None:
    boxes, tracks = tmp_path / "boxes.csv", tmp_path / "track.csv"
    boxes.write_text(doubled("anno_id,frame,x1,y1,x2,y2\n0,0,1,2,3,4\n", "x1"))
    expected = ("bad-field", 'The table has 2 columns "x1"; expected one.')
    assert problem(lambda: read_boxes(boxes, manifest=MANIFEST)) == expected
    tracks.write_text(f"{','.join(TRACK_COLUMNS)},ts\n")
    assert problem(lambda: read_tracks(tracks)) == (
        "bad-field",
        'The table has 2 columns "ts"; expected one.',
    )


def test_two_columns_of_one_name_are_no_frame() -> None:
    frame = manifest_frame(MANIFEST).assign(ttc=TRUTH.ttc_s)
    for name in ("ttc", "track_id"):
        twice = pd.concat([frame, frame[[name]]], axis=1)
        expected = ("bad-field", f'The table has 2 columns "{name}"; expected one.')
        assert problem(partial(predictions_from_frame, twice, manifest=MANIFEST)) == expected


def test_the_table_of_score_is_no_prediction_file(tsttc: Tsttc, tmp_path: Path) -> None:
    table = tmp_path / "per-sequence.csv"
    tsttc("score", EXAMPLES / "predictions.json", "--truth", EXAMPLES / "truth.csv", "--per-sequence", table)
    checked = tsttc("check", table, "--manifest", EXAMPLES / "manifest.csv")
    assert checked.exit_code == 1
    assert 'remove "ttc_s" and rename "predicted_ttc_s" to ttc' in checked.stderr


def test_a_frame_may_name_its_seconds_as_a_file_does_and_needs_a_rate_for_ratios() -> None:
    frame = manifest_frame(MANIFEST)
    for name in ("ttc", "ttc_s"):
        read = predictions_from_frame(frame.assign(**{name: TRUTH.ttc_s}), manifest=MANIFEST)
        assert read.ttc_s.tolist() == TRUTH.ttc_s.tolist()
    ratios = np.array([0.9, 1.1, 0.8])
    with_ratios = frame.assign(scale_ratio=ratios)
    for column in (None, "scale_ratio"):
        with pytest.raises(ValueError, match="needs one column fps or frame_gap"):
            predictions_from_frame(with_ratios, manifest=MANIFEST, column=column)
        read = predictions_from_frame(with_ratios.assign(frame_gap=5), manifest=MANIFEST, column=column)
        assert (read.unit, read.ttc_s.tolist()) == (
            "scale_ratio",
            scale_ratio_to_ttc(ratios, fps_hz=2).tolist(),
        )
    # The true times beside the predictions.
    both = frame.assign(ttc=TRUTH.ttc_s, ttc_s=2.0)
    assert predictions_from_frame(both, manifest=MANIFEST).ttc_s.tolist() == [2.0] * 3
    for others in ({"mine": 1.0}, {"ttc_s": 1.0, "predicted_ttc_s": 2.0}):
        with pytest.raises(KeyError, match="expected ttc_s, ttc or scale_ratio, or column="):
            predictions_from_frame(frame.assign(**others), manifest=MANIFEST)


def test_masked_entries_are_no_values() -> None:
    values = np.ma.masked_array([4.0, -10.0, 1.0], mask=[False, True, False])
    assert problem(lambda: write_predictions(manifest=MANIFEST, ttc_s=values))[0] == "nan"
    ratios = np.ma.masked_array([0.9, 1.1, 0.8], mask=[True, False, False])
    assert problem(lambda: write_predictions(manifest=MANIFEST, scale_ratio=ratios, frame_gap=5))[0] == "nan"
    assert np.isnan(Predictions.from_arrays(manifest=MANIFEST, ttc_s=values).ttc_s).tolist() == [
        False,
        True,
        False,
    ]
    unmasked = np.ma.masked_array([4, -10, 1])
    assert write_predictions(manifest=MANIFEST, ttc_s=unmasked)


@pytest.mark.parametrize(
    "values",
    [
        np.array([4 + 1j, -10, 1]),
        [4 + 1j, -10, 1],
        np.array([4, 10, 1], dtype="m8[s]"),
        np.array([4, 10, 1], "M8[s]"),
    ],
)
def test_complex_numbers_dates_and_durations_are_no_seconds(values: object) -> None:
    for write in (write_predictions, Predictions.from_arrays):
        with pytest.raises(TypeError, match="expected real numbers"):
            write(manifest=MANIFEST, ttc_s=values)  # type: ignore[operator]


def test_check_counts_infinite_values(tsttc: Tsttc, tmp_path: Path) -> None:
    mine, manifest = tmp_path / "mine.json", tmp_path / "manifest.csv"
    mine.write_text('{"0": Infinity, "1": -Infinity, "2": 1}')
    manifest.write_bytes(MANIFEST.to_csv())
    assert "\n2 values infinite: " in tsttc("check", mine, "--manifest", manifest).stdout
    assert '"n_infinite": 2' in tsttc("check", mine, "--manifest", manifest, "--json").stdout


@pytest.mark.parametrize(
    "rows", [[13.94, 2.0], np.array([1.0, 2.0]), np.array([True, False]), ["1", "2"], [True]]
)
def test_rows_are_whole_numbers_and_never_rounded(rows: object) -> None:
    with pytest.raises(TypeError, match="expected whole numbers, such as rows"):
        whole_numbers(rows, name="rows")


@pytest.mark.parametrize("rows", [[1, 2], range(1, 3), np.array([1, 2], dtype=np.uint8), (1, 2)])
def test_rows_may_have_any_type_of_whole_numbers(rows: object) -> None:
    assert whole_numbers(rows, name="rows").tolist() == [1, 2]
    assert whole_numbers([], name="rows").tolist() == []
