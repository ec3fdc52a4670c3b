"""`tsttc baseline annotate`: from a table of tracks to a file that scores and boards take."""

import json
from pathlib import Path

import pytest

from evaluator import read_truth
from tests.evaluator.worlds import Tsttc
from tests.tsttc_baselines.annotation.made_tracks import HEADER, approaching, text


@pytest.fixture
def track_file(tmp_path: Path) -> Path:
    path = tmp_path / "track.csv"
    path.write_text(text(approaching()))
    return path


def test_the_file_is_ground_truth_and_says_how_each_value_came_about(
    tsttc: Tsttc, tmp_path: Path, track_file: Path
) -> None:
    out, boxes = tmp_path / "truth.csv", tmp_path / "boxes.csv"
    result = tsttc("baseline", "annotate", track_file, "-o", out, "--boxes", boxes)
    assert result.exit_code == 0
    assert result.stdout.splitlines() == [
        f"{out}: 2 sequences of 1 recording.",
        "Read: 12 observations of 1 track.",
        "The velocities of 3, 5 and 10 frames agree in 2 sequences.",
        "They differ in 0: radar decides 0, and 0 without radar have the velocity of 10 frames.",
    ]
    lines = out.read_text().splitlines()
    assert lines[0] == "anno_id,bag_stamp,cam_id,ts,track_id,ttc,q,frames,inliers,choice"
    assert [line.split(",")[6:] for line in lines[1:]] == [
        ["10", "6", "6", "agree"],
        ["10", "10", "10", "agree"],
    ]
    assert read_truth(out).ttc_s.tolist() == pytest.approx([2.5, 1.9])
    assert len(boxes.read_text().splitlines()) == 1 + 2 * 6
    predictions = tmp_path / "p.json"
    predictions.write_text(json.dumps({"0": 2.5, "1": 1.9}))
    assert tsttc("score", predictions, "--truth", out).exit_code == 0


def test_counts_come_as_a_document(tsttc: Tsttc, tmp_path: Path) -> None:
    source, out = tmp_path / "track.csv", tmp_path / "truth.csv"
    rows = [f"{line},{'' if number == 3 else -10}" for number, line in enumerate(approaching())]
    source.write_text(text(rows, header=f"{HEADER},radar_velocity"))
    document = json.loads(tsttc("baseline", "annotate", source, "-o", out, "--overlapping", "--json").stdout)
    assert document["counts"]["sequences"] == 7
    assert document["counts"]["without_radar"] == 1
    printed = tsttc("baseline", "annotate", source, "-o", out).stdout
    assert "The radar has no velocity for 1 observation." in printed


def test_a_rejected_table_names_its_lines_and_leaves_no_file(tsttc: Tsttc, tmp_path: Path) -> None:
    source, out = tmp_path / "track.csv", tmp_path / "truth.csv"
    source.write_text(text(approaching(yaw="nan")))
    result = tsttc("baseline", "annotate", source, "-o", out)
    assert result.exit_code == 1
    assert "1. line 2: yaw is nan; expected a finite number." in result.stderr
    assert not out.exists()


def test_a_folder_needs_its_format(tsttc: Tsttc, tmp_path: Path, track_file: Path) -> None:
    for source, options, expected in (
        (tmp_path, (), "expects a table (folders: --format kitti)."),
        (track_file, ("--format", "kitti"), "is a file; --format kitti expects a folder of labels."),
    ):
        result = tsttc("baseline", "annotate", source, "-o", tmp_path / "t.csv", *options)
        assert result.exit_code == 2
        assert expected in " ".join(result.stderr.split())


def test_the_noise_of_labels_is_shown_by_range_with_what_it_assumes(
    tsttc: Tsttc, tmp_path: Path, track_file: Path
) -> None:
    out = tmp_path / "truth.csv"
    assert tsttc("baseline", "annotate", track_file, "-o", out, "--overlapping").exit_code == 0
    for source in (out, tmp_path):
        result = tsttc("baseline", "noise", source)
        assert result.exit_code == 0
        assert result.stdout.splitlines()[1].split() == ["overall", "6", "0.0", "0.0"]
        assert "successive labels share 9 of their 10 frames" in result.stdout
    document = json.loads(tsttc("baseline", "noise", out, "--frames", "1", "--json").stdout)
    assert (document["frames"], document["ranges"][0]["n_pairs"]) == (1, 6)
