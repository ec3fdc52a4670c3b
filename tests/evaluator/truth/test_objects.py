"""What annotations and tables say of the object apart from its time: kept if stated, never required."""

from pathlib import Path

import numpy as np
import pytest

from evaluator import Rejected, read_truth
from evaluator.truth.objects import text_of
from tests.evaluator.toolkit_folders import camera, write_folder

SIX = list(range(6))
HEADER = "anno_id,bag_stamp,cam_id,ts,track_id,ttc"


def table(folder: Path, columns: str, *fields: str) -> Path:
    rows = [f"{row},a,1,{100 + row},4,5.0,{field}" for row, field in enumerate(fields)]
    path = folder / "truth.csv"
    path.write_text("\n".join([f"{HEADER},{columns}", *rows, ""]))
    return path


def test_annotations_keep_occlusion_lane_and_box_and_the_table_of_them_too(tmp_path: Path) -> None:
    write_folder(tmp_path / "folder", {"a.pkl": [camera({7: SIX}, occ_ratio=0.25, same_lane=np.False_)]})
    truth = read_truth(tmp_path / "folder")
    (tmp_path / "truth.csv").write_bytes(truth.to_csv())
    for each in (truth, read_truth(tmp_path / "truth.csv")):
        assert each.objects.occ_ratio.tolist() == [0.25]
        assert each.objects.same_lane.tolist() == [0.0]
        assert each.objects.box_height.tolist() == [0.25]
        assert each.digest == truth.digest


@pytest.mark.parametrize("strange", ["much", 2.0, True, None, [0.1]])
def test_annotations_that_state_something_else_are_read_all_the_same(tmp_path: Path, strange: object) -> None:
    write_folder(tmp_path, {"a.pkl": [camera({7: SIX}, occ_ratio=strange, same_lane="yes", box2d=strange)]})
    objects = read_truth(tmp_path).objects
    assert (objects.occ_ratio, objects.same_lane, objects.box2d) == (None, None, None)


def test_values_may_be_missing_and_do_not_change_the_digest(tmp_path: Path) -> None:
    plain = read_truth(table(tmp_path, "note", "x", "y")).digest
    truth = read_truth(table(tmp_path, "occ_ratio,same_lane,box2d", "0.5,True,0.1 0.1 0.2 0.4", ",,"))
    assert truth.digest == plain
    assert np.isnan(truth.objects.occ_ratio).tolist() == [False, True]
    assert truth.to_table().box2d == [[0.1, 0.1, 0.2, 0.4], None]


@pytest.mark.parametrize(
    ("column", "text", "expected"),
    [
        ("occ_ratio", "1.5", "a number from 0 to 1, or nothing"),
        ("occ_ratio", "nan", "a number from 0 to 1, or nothing"),
        ("same_lane", "left", "1, 0 or nothing"),
        ("box2d", "100 100 200 300", '"x1 y1 x2 y2" as parts'),
        ("box2d", "0.2 0.1 0.1 0.3", "x1 < x2"),
    ],
)
def test_a_field_of_a_table_that_makes_no_sense_is_named(
    tmp_path: Path, column: str, text: str, expected: str
) -> None:
    with pytest.raises(Rejected) as caught:
        read_truth(table(tmp_path, column, "", text))
    problem = caught.value.problems[0]
    assert (problem.code, problem.where) == ("bad-field", "line 3")
    assert problem.message.startswith(f'{column} is "{text}"; expected ')
    assert expected in problem.message


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, ""), (0.25, "0.25"), (True, "1"), (False, "0"), ([0.25, 0.5, 0.75, 1.0], "0.25 0.5 0.75 1.0")],
)
def test_a_value_is_written_as_it_is_read(value: float | list[float] | None, text: str) -> None:
    assert text_of(value) == text
