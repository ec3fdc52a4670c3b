"""A folder at fault is refused in words before anything runs; nothing is written."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from evaluator import Rejected
from tests.tsttc_baselines import made_folders
from tests.tsttc_baselines.made_folders import (
    GREY_LEVELS,
    box,
    image_path,
    made_folder,
    write_boxes,
    write_manifest,
)
from tsttc_baselines.folder_checks import require_usable
from tsttc_baselines.folders import read_folder
from tsttc_baselines.images import ImageCache
from tsttc_baselines.methods import get_method


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return made_folder(tmp_path)


def refusal(folder: Path, *, frame_gap: int = 5) -> tuple[str, str, str]:
    """Code, pointer and message of the one problem of a folder."""
    with pytest.raises(Rejected) as rejected:
        require_usable(read_folder(folder), method=GREY_LEVELS, frame_gap=frame_gap)
    [problem] = rejected.value.problems
    return problem.code, problem.where, problem.message


@pytest.mark.parametrize("extension", ["jpg", "png"])
def test_frames_and_boxes_of_a_folder_are_those_of_its_files(tmp_path: Path, extension: str) -> None:
    frame_folder = read_folder(made_folder(tmp_path, extension=extension))
    clip = frame_folder.clip(1, cache=ImageCache())
    assert frame_folder.manifest.anno_id.tolist() == [0, 1, 2]
    np.testing.assert_array_equal(clip.boxes, [box(frame) for frame in range(6)])
    assert clip.grey(0).shape == (96, 160)
    for frame in range(6):
        difference = clip.colour(frame).astype(int) - made_folders.picture(1, frame)
        assert np.abs(difference).mean() < (4 if extension == "jpg" else 1e-9)


def test_images_may_stand_beside_the_tables(tmp_path: Path) -> None:
    made_folder(tmp_path)
    (tmp_path / "images" / "0007").rename(tmp_path / "0007")
    (tmp_path / "images").rmdir()
    assert read_folder(tmp_path).clip(0, cache=ImageCache()).grey(5).shape == (96, 160)


def test_normalised_boxes_become_pixels_of_the_image(folder: Path) -> None:
    size = np.array([160, 96, 160, 96])
    changes = {(n, frame): (np.array(box(frame)) / size).tolist() for n in range(3) for frame in range(6)}
    write_boxes(folder, changes=changes, head="#unit=normalised")
    clip = read_folder(folder).clip(0, cache=ImageCache())
    np.testing.assert_allclose(clip.boxes[2], box(2), rtol=1e-12)


# --- refused ---------------------------------------------------------------------------------------------


def without(name: str) -> Callable[[Path], object]:
    return lambda folder: (folder / name).unlink()


def boxes_text(text: str) -> Callable[[Path], object]:
    return lambda folder: (folder / "boxes.csv").write_text(text)


HEAD = "anno_id,frame,x1,y1,x2,y2\n"


@pytest.mark.parametrize(
    ("spoil", "code", "where", "words"),
    [
        (without("manifest.csv"), "unreadable", "", "has a boxes.csv and no manifest.csv; expected"),
        (without("boxes.csv"), "unreadable", "", "has no boxes.csv and no annotation files; exp"),
        (
            lambda folder: (folder / "manifest.csv").write_text("anno_id,bag_stamp,cam_id,track_id\n"),
            "missing-columns",
            "manifest.csv, line 1",
            "has no column ts; found",
        ),
        (lambda folder: (folder / "manifest.csv").write_bytes(b"\xff"), "not-utf8", "manifest.csv", "Byte 0"),
        (boxes_text(""), "missing-columns", "boxes.csv, line 1", "no column anno_id, frame, x1, y1, x2, y2"),
        (
            boxes_text("anno_id,frame,x,y,w,h\n0,5,1,1,9,9\n"),
            "missing-columns",
            "boxes.csv, line 1",
            'no column x1, y1, x2, y2; found "anno_id,frame,x,y,w,h", expected anno_id,frame,x1,y1,x2,y2.',
        ),
        (boxes_text(HEAD + "0,5,1,1,9\n"), "bad-csv", "boxes.csv, line 2", "has 5 fields; expected 6"),
        (boxes_text(HEAD + "0,6,1,1,9,9"), "bad-field", "boxes.csv, line 2", 'frame is "6"; expected 0 to'),
        (boxes_text(HEAD + "0,5,1,z,9,9"), "bad-field", "boxes.csv, line 2", 'y1 is "z"; expected a number'),
        (
            boxes_text(HEAD + "0,5,1,1,9,9\n\n0,5,1,1,9,9\n"),
            "duplicate-keys",
            "boxes.csv, line 4",
            "Frame 5 of 0 already has a box in line 2; expected one.",
        ),
        (
            boxes_text(HEAD + "0,5,1,1,9,9\n7,5,1,1,9,9\n8,5,1,1,9,9\n"),
            "unknown-keys",
            "boxes.csv, line 3",
            "The manifest lacks 2 of the anno_ids: 7, 8; expected its own.",
        ),
        (boxes_text(HEAD), "bad-box", "boxes.csv", "The table has no box; expected one for each target"),
        (
            boxes_text(HEAD + "0,0,.1,.1,.2,.2\n0,5,.1,.1,.2,.3\n"),
            "bad-box",
            "boxes.csv",
            "The largest coordinate is 0.3, which is not a pixel; expected pixels, or #unit=normalised",
        ),
        (
            boxes_text("#unit=normalised\n" + HEAD + "0,0,10,10,20,20\n"),
            "bad-box",
            "boxes.csv",
            "The largest coordinate is 20 after #unit=normalised; expected parts of the image, 0 to 1.",
        ),
        (
            boxes_text("#unit=metres\n" + HEAD + "0,0,10,10,20,20\n"),
            "bad-field",
            "boxes.csv",
            'The unit is "#unit=metres"; expected #unit=normalised, #unit=pixels or no such line.',
        ),
        (
            boxes_text(HEAD + "0,4,10,10,20,20\n0,5,10,10,20,20\n"),
            "bad-box",
            "boxes.csv",
            "No sequence has boxes for the frames 0 and 5; expected them for a gap of 5.",
        ),
        (
            boxes_text(HEAD + "".join(f"{n},{k},900,400,1000,500\n" for n in range(3) for k in (0, 5))),
            "bad-box",
            "boxes.csv",
            "3 of 3 target boxes of cam1 in 0007 reach beyond its images, to 1000 and 500; "
            "expected pixels of 160×96 images.",
        ),
    ],
)  # fmt: skip
def test_a_table_at_fault_is_refused_with_position_content_and_expectation(
    folder: Path, spoil: Callable[[Path], object], code: str, where: str, words: str
) -> None:
    spoil(folder)
    problem = refusal(folder)
    assert problem[:2] == (code, where or folder.name)
    assert words in problem[2]


def test_a_folder_of_neither_kind_is_refused(tmp_path: Path) -> None:
    code, where, message = refusal(tmp_path)
    assert (code, where) == ("unreadable", tmp_path.name)
    assert message == (
        "The folder has neither manifest.csv with boxes.csv nor annotation files; "
        "expected manifest.csv and boxes.csv, or the dataset's annotation files (*.pkl)."
    )


def test_a_folder_without_any_image_is_refused_unless_no_image_is_looked_at(tmp_path: Path) -> None:
    write_manifest(tmp_path)
    write_boxes(tmp_path)
    code, where, message = refusal(tmp_path)
    path = image_path(tmp_path, 0, 5).relative_to(tmp_path / "images")
    assert (code, where) == ("bad-frame", path.as_posix())
    assert message.startswith("No sequence has an image of its target frame; expected the first one here")
    require_usable(read_folder(tmp_path), method=get_method("detection"), frame_gap=5)


def test_every_fault_of_a_table_is_named_at_once(folder: Path) -> None:
    boxes_text(HEAD + "0,5,1,1,9,x\n9,5,1,1,9,9\n0,9,1,1,9,9\n")(folder)
    with pytest.raises(Rejected) as rejected:
        read_folder(folder)
    assert {problem.code for problem in rejected.value.problems} == {"bad-field", "unknown-keys"}
    assert rejected.value.n_problems == 3
