"""Real 3D boxes: the labels of KITTI's drives give the ground truth that was made from them."""

from pathlib import Path

import pytest

from evaluator import read_truth
from evaluator.problems import Rejected
from tsttc_baselines.annotation.kitti import read_kitti
from tsttc_baselines.annotation.pipeline import Depth, annotate

LINE = "{frame} 7 Car {truncated} 0 0.1 100 100 140 130 1.5 1.8 4.0 {x} 1.0 {z} {rotation}"


@pytest.mark.slow
@pytest.mark.parametrize(("depth", "least"), [("measured", 1.0), ("checked", 0.99)])
def test_the_ground_truth_of_kitti_dev_is_reproduced(
    kitti: Path, kitti_labels: Path, depth: Depth, least: float
) -> None:
    annotated = annotate(read_kitti(kitti_labels), cut="overlapping", depth=depth).table
    own = dict(
        zip(
            zip(annotated.bag_stamp, annotated.cam_id, annotated.ts_ns, annotated.track_id, strict=True),
            annotated.ttc_s,
            strict=True,
        )
    )
    truth = read_truth(kitti / "truth.csv")
    table = truth.to_table()
    keys = list(zip(table.bag_stamp, table.cam_id, table.ts_ns, table.track_id, strict=True))
    assert len(keys) == 10_517
    n_same = sum(abs(own.get(key, 1e9) - ttc) <= 1e-3 for key, ttc in zip(keys, table.ttc_s, strict=True))
    assert n_same >= least * len(keys)


def write_labels(folder: Path, *, n_frames: int = 6, **fields: object) -> Path:
    values = {"truncated": 0, "x": 3.0, "rotation": 0.0} | fields
    lines = [LINE.format(frame=frame, z=20 - frame, **values) for frame in range(n_frames)]
    (folder / "0003.txt").write_text("\n".join(["0 -1 DontCare -1 -1 -10" + " -1000" * 11, *lines, ""]))
    return folder


def test_a_label_gives_names_and_the_nearest_corner(tmp_path: Path) -> None:
    truth = annotate(read_kitti(write_labels(tmp_path)))
    assert (truth.table.bag_stamp, truth.table.cam_id, truth.table.track_id) == (["0003"], ["2"], ["7"])
    assert truth.table.ts_ns == [500_000_000]
    assert truth.table.ttc_s == pytest.approx([(15 - 0.9) / 10])


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["0 7 Car 0 0 0.1 100 100 140 130 1.5 1.8 4.0 3 1 nan 0"], "0003.txt, line 1: y is nan"),
        (["0 7 Car 0 0 0.1"], "0003.txt, line 1: The line has 6 fields; expected the 17"),
        (["x 7 Car 0 0 0.1" + " 1" * 11], '0003.txt, line 1: The frame is "x"'),
        (["0 7 Car 0 0 0.1" + " 1" * 10 + " x"], "A field is not a number: could not convert string"),
        (["0 8 Cyclist 0 0 0.1" + " 1" * 11], "There are no tracked vehicles"),
        (
            [LINE.format(frame=frame, truncated=0, x=3, z=20, rotation=0) for frame in (4, 3)],
            "0003.txt, line 2: ts is 300000000, earlier than 400000000 at 0003.txt, line 1",
        ),
    ],
)
def test_labels_at_fault_are_named_by_file_and_line(tmp_path: Path, lines: list[str], message: str) -> None:
    (tmp_path / "0003.txt").write_text("\n".join(lines))
    with pytest.raises(Rejected) as fault:
        read_kitti(tmp_path)
    assert message in str(fault.value)
