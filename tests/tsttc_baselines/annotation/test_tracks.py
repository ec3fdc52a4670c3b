"""track.csv: what is read, and every fault of it as a problem with its line."""

from pathlib import Path

import numpy as np
import pytest

from evaluator.problems import PROBLEM_CODES, Rejected
from tests.tsttc_baselines.annotation.made_tracks import HEADER, approaching, row, text
from tsttc_baselines.annotation.tracks import COLUMNS, read_tracks
from tsttc_baselines.estimates import PROBLEM_CODES as BASELINE_CODES


def write(folder: Path, content: str) -> Path:
    path = folder / "track.csv"
    path.write_text(content)
    return path


def test_columns_may_have_any_order_and_company(tmp_path: Path) -> None:
    lines = [line.split(",") for line in text(approaching(2)).splitlines()]
    mixed = "\n".join(
        ",".join(["x" if number else "note", *reversed(line)]) for number, line in enumerate(lines)
    )
    tracks = read_tracks(write(tmp_path, mixed))
    assert tracks.key == (("r", "1", "1"),) * 2
    assert tracks.centre_m[:, 1].tolist() == [32.0, 31.0]
    assert not tracks.has_radar


def test_a_radar_column_may_have_gaps_and_boxes_may_be_empty(tmp_path: Path) -> None:
    edges = dict.fromkeys(("box_x1", "box_y1", "box_x2", "box_y2"), "")
    rows = [f"{row(0)},-3.5", f"{row(1, **edges)},", f"{row(2)},nan"]
    tracks = read_tracks(write(tmp_path, text(rows, header=f"{HEADER},radar_velocity")))
    assert tracks.has_radar
    assert np.isnan(tracks.radar_mps).tolist() == [False, True, True]
    assert np.isnan(tracks.box_px).all(axis=1).tolist() == [False, True, False]


@pytest.mark.parametrize(
    ("rows", "code", "message"),
    [
        ([row(0, y="nan")], "bad-field", "line 2: y is nan; expected a finite number."),
        ([row(0, y="")], "bad-field", 'line 2: y is ""; expected a number.'),
        ([row(0, width=0)], "bad-field", "line 2: width is 0 m; expected a size above 0."),
        ([row(0, ts="1.5")], "bad-field", 'line 2: ts is "1.5"; expected a whole number of nanoseconds'),
        ([row(0, truncated="yes")], "bad-field", 'line 2: truncated is "yes"; expected 0 or 1.'),
        ([row(0, track_id="a/b")], "bad-field", 'line 2: track_id is "a/b": it contains "/".'),
        ([row(0, box_x2=90)], "bad-box", "line 2: The box is 100, 100, 90, 130; expected its left, top,"),
        ([row(0, box_x2="")], "bad-box", "line 2: The box is 100, 100, nan, 130; expected"),
        (
            [row(0), row(0, track="2"), row(0)],
            "duplicate-keys",
            'line 4: The track "r/1/1" already has ts 0, at line 2; expected one row for a frame.',
        ),
        (
            [row(5), row(4)],
            "reversed-time",
            "line 3: ts is 400000000, earlier than 500000000 at line 2, of the same track",
        ),
        ([row(0) + ",1"], "bad-csv", f"line 2: The row has 17 fields; expected {len(COLUMNS)}."),
        ([], "empty", "There are no tracked vehicles; expected at least one."),
    ],
)
def test_every_fault_is_a_problem_with_its_line(
    tmp_path: Path, rows: list[str], code: str, message: str
) -> None:
    with pytest.raises(Rejected) as fault:
        read_tracks(write(tmp_path, text(rows)))
    assert message in str(fault.value)
    assert [problem.code for problem in fault.value.problems] == [code]
    assert code in {**PROBLEM_CODES, **BASELINE_CODES}


def test_missing_columns_are_named(tmp_path: Path) -> None:
    with pytest.raises(Rejected, match="The table has no column yaw, truncated"):
        read_tracks(write(tmp_path, HEADER.replace("yaw,", "").replace(",truncated", "")))
    with pytest.raises(Rejected, match="The table has no column bag_stamp"):
        read_tracks(write(tmp_path, ""))
