"""Scores of groups: they add up to the whole, and say where the errors are."""

from typing import Any

import numpy as np
import pytest

from evaluator import GroundTruth, Predictions, Report, Table, confidence_intervals, evaluate
from evaluator.scoring.breakdown import GROUPS, scores_of

N = 240
OBJECTS = ("occlusion", "lane", "box-size")


@pytest.fixture(scope="module")
def truth() -> GroundTruth:
    """24 recordings of ten sequences each, from two cameras."""
    rng = np.random.default_rng(3)
    return GroundTruth.from_table(
        Table(
            anno_id=list(range(N)),
            bag_stamp=[f"{row // 10:04d}" for row in range(N)],
            cam_id=[str(row % 2) for row in range(N)],
            ts_ns=[1_000_000_000 * row for row in range(N)],
            track_id=[str(row) for row in range(N)],
            ttc_s=(rng.choice([-1, 1], N) * rng.uniform(0.5, 24, N)).tolist(),
            occ_ratio=[(None, 0.0, 0.2, 0.5, 0.9)[row % 5] for row in range(N)],
            same_lane=[(True, False)[row % 2] for row in range(N)],
            box2d=[[0.1, 0.1, 0.2, 0.1 + 0.01 * (1 + row % 50)] for row in range(N)],
        )
    )


@pytest.fixture(scope="module")
def predictions(truth: GroundTruth) -> Predictions:
    noise = np.exp(np.random.default_rng(4).normal(0, 0.1, N))
    return Predictions.from_arrays(ttc_s=truth.ttc_s * noise, manifest=truth.manifest)


@pytest.fixture(scope="module")
def report(truth: GroundTruth, predictions: Predictions) -> Report:
    return evaluate(predictions, truth, keep_sequences=True)


@pytest.mark.parametrize("by", GROUPS)
def test_groups_hold_every_sequence_once_and_average_to_the_whole(report: Report, by: str) -> None:
    rows = report.breakdown(by)
    assert sum(row.n_sequences for row in rows) == N
    for metric in ("mid", "rte"):
        sums = [float(row.scores[metric]) * row.n_sequences for row in rows]
        assert sum(sums) / N == pytest.approx(report.scores["overall"].means[metric])


def test_groups_have_the_words_and_edges_of_the_documents(report: Report) -> None:
    assert [row.group for row in report.breakdown("occlusion")] == (
        ["0%", "0–25%", "25–50%", "50–100%", "not stated"]
    )
    assert [row.group for row in report.breakdown("lane")] == ["same lane", "other lane"]
    assert [row.group for row in report.breakdown("box-size")] == (
        ["0–5%", "5–10%", "10–20%", "20–40%", "over 40%"]
    )


def test_the_interval_of_one_group_of_all_is_the_board_s(
    truth: GroundTruth, predictions: Predictions, report: Report
) -> None:
    assert report.sequences is not None
    (whole,) = scores_of(report.details, groups={"all": np.arange(N)}, with_intervals=True)
    board = confidence_intervals(predictions, truth)
    assert list(whole.intervals) == list(board)
    for name, ends in board.items():
        assert whole.intervals[name] == (None if ends is None else pytest.approx(ends, rel=1e-4))
    assert any(board.values())


@pytest.mark.parametrize("by", OBJECTS)
def test_a_truth_without_the_column_says_which_one(by: str, truth: GroundTruth) -> None:
    bare = GroundTruth(truth.manifest, truth.ttc_s, truth.digest)
    evaluated = evaluate(
        Predictions.from_arrays(ttc_s=truth.ttc_s, manifest=truth.manifest), bare, keep_sequences=True
    )
    with pytest.raises(ValueError, match=r"The ground truth does not state .*; expected a table with"):
        evaluated.breakdown(by)


def test_a_report_without_sequences_says_how_to_get_them(
    predictions: Predictions, truth: GroundTruth
) -> None:
    for look in (lambda r: r.by("camera"), lambda r: r.frame(), lambda r: r.breakdown("camera")):
        with pytest.raises(ValueError, match="keep_sequences=True"):
            look(evaluate(predictions, truth))


def test_an_unknown_group_names_those_that_exist(report: Report) -> None:
    with pytest.raises(ValueError, match="Unknown group 'weather'; expected one of recording, camera, range"):
        report.breakdown("weather")


def test_groups_are_texts_in_either_spelling(report: Report) -> None:
    pytest.importorskip("pandas")
    assert report.by("box_size").equals(report.by("box-size"))
    assert report.by("box_size").index.name == "box-size"
    other: Any = np.arange(N)
    with pytest.raises(TypeError, match=r"The group is of type ndarray; expected one of recording, camera"):
        report.by(other)


def test_frames_of_groups_take_the_unit_of_their_intervals(report: Report) -> None:
    pytest.importorskip("pandas")
    frame = report.by("camera", with_intervals=True, unit="recording")
    rows = report.breakdown("camera", with_intervals=True, unit="recording")
    assert [tuple(ends) for ends in frame[["mid_low", "mid_high"]].to_numpy()] == [
        row.intervals["mid"] for row in rows
    ]
    with pytest.raises(ValueError, match="day"):
        report.by("camera", with_intervals=True, unit="day")


def test_a_range_has_the_warning_error_of_its_protocol(truth: GroundTruth, predictions: Predictions) -> None:
    scored = evaluate(predictions, truth, protocol="tsttc-2").scores["overall"]
    assert scored.warning == scored.means["warning"] is not None
    assert evaluate(predictions, truth, protocol="tsttc-1").scores["overall"].warning is None


def test_frames_for_pandas_have_a_row_for_each_group_and_each_sequence(report: Report) -> None:
    pytest.importorskip("pandas")
    frame = report.by("camera", with_intervals=True)
    assert list(frame.index) == ["0", "1"]
    assert {"n_sequences", "n_recordings", "mid", "mid_low", "mid_high", "rte_negative"} <= set(frame.columns)
    assert (frame["mid_low"] < frame["mid"]).all()
    sequences = report.frame()
    assert len(sequences) == N
    assert sequences["mid"].mean() == pytest.approx(report.scores["overall"].mid)
    assert {"ttc_s", "predicted_ttc_s", "occ_ratio", "same_lane", "box_height"} <= set(sequences.columns)


def test_a_report_is_short_as_repr_and_a_table_as_text_and_in_a_notebook(report: Report) -> None:
    assert len(repr(report)) < 100
    lines = str(report).splitlines()
    assert lines[0].split() == ["TTC", "range", "MiD", "×10⁻⁴", "RTE", "%", "count"]
    assert [line.split()[0] for line in lines[1:6]] == ["overall", "crucial", "small", "large", "negative"]
    html = report._repr_html_()
    assert html.count("<tr>") == 6
    assert f"{report.scores['crucial'].mid:.2f}" in html
