"""A run gives every sequence a value, says which are fallbacks, and continues where it was ended."""

import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from evaluator import Rejected, read_predictions
from tests.tsttc_baselines.made_folders import (
    GREY_LEVELS,
    box,
    image_path,
    made_folder,
    picture,
    stamp,
    write_boxes,
    write_image,
)
from tsttc_baselines.folders import read_folder
from tsttc_baselines.running import Run, run_method

N = 3


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "in").mkdir()
    return made_folder(tmp_path / "in", n=N)


def estimate(folder: Path, *, out: str = "p.json", **options: Any) -> Run:
    parameters = {
        name: options.pop(name) for name in ("power", "constant", "refused", "broken") if name in options
    }
    return run_method(
        folder=read_folder(folder),
        method=GREY_LEVELS,
        parameters=parameters,
        out=folder.parent / out,
        **{"frame_gap": 5, **options},
    )


def names(folder: Path) -> set[str]:
    """The names next to the folder."""
    return {path.name for path in folder.parent.iterdir()} - {folder.name}


def root_of_areas(first: Sequence[float], last: Sequence[float]) -> float:
    def area(edges: Sequence[float]) -> float:
        return (edges[2] - edges[0]) * (edges[3] - edges[1])

    return math.sqrt(area(first) / area(last))


@pytest.mark.slow
def test_the_file_holds_every_sequence_and_how_it_was_made(folder: Path) -> None:
    done = estimate(folder, power=0.5)
    data = (folder.parent / "p.json").read_bytes()
    predictions = read_predictions(data, manifest=read_folder(folder).manifest)
    assert predictions.unit == "scale_ratio"
    document = json.loads(data)
    assert document["frame_gap"] == 5
    assert list(document["predictions"].values()) == done.scale_ratio.tolist()
    assert predictions.meta is not None
    assert set(predictions.meta) == {
        *("method", "version", "provenance", "parameters", "n_fallback", "opencv", "code"),
    }
    assert predictions.meta["parameters"] == {"power": 0.5, "constant": 0.0, "refused": -1, "broken": -1}
    assert predictions.meta["n_fallback"] == {}
    assert names(folder) == {"p.json"}


@pytest.mark.slow
def test_a_gap_of_one_looks_at_two_frames(folder: Path) -> None:
    for anno_id in range(N):
        for frame in range(4):
            image_path(folder, anno_id, frame).unlink()
    assert estimate(folder, frame_gap=1).n_fallback == {}
    with pytest.raises(Rejected, match=r"3 of 3 sequences .*, 2 of them .*: The image is missing"):
        estimate(folder, frame_gap=2)


# --- what is wrong with one sequence ---------------------------------------------------------------------

Spoil = Callable[[Path], object]


def with_box(frame: int, *values: float) -> Spoil:
    return lambda folder: write_boxes(folder, n=N, changes={(1, frame): values})


def with_image(frame: int, change: Callable[[Path], object]) -> Spoil:
    return lambda folder: change(image_path(folder, 1, frame))


def cut_off(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-200])


def cut_off_png(path: Path) -> None:
    write_image(path.with_suffix(".png"), picture(1, 3))
    path.unlink()
    cut_off(path.with_suffix(".png"))


def move_by_a_millisecond(path: Path) -> None:
    path.rename(path.with_name(f"{int(path.stem) + 1_000_000}.jpg"))


JPG = f"images/0007/cam1/{stamp(1, 3)}.jpg"
BOX_0, BOX_5 = "(50, 30, 90, 60)", "(45, 25, 95, 65)"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spoil", "reason", "where", "message"),
    [
        (with_box(5), "no box in the target frame", "boxes.csv, sequence 1",
         "There is no box for the target; expected one."),
        (with_box(0), "no box in the reference frame", "boxes.csv, sequence 1",
         "There is no box for the reference frame 0; expected one."),
        (with_box(5, math.nan, 1, 50, 50), "box is not a number", "boxes.csv, sequence 1",
         "The box of the target is (nan, 1, 50, 50); expected numbers."),
        (with_box(0, 1, 1, math.inf, 9), "box is not a number", "boxes.csv, sequence 1",
         "The box of the reference frame 0 is (1, 1, inf, 9); expected numbers."),
        (with_box(5, 50, 10, 20, 60), "box is reversed", "boxes.csv, sequence 1",
         "The box of the target is (50, 10, 20, 60); expected x1 < x2 and y1 < y2."),
        (with_box(5, 50, 10, 60, 10), "box is empty", "boxes.csv, sequence 1",
         "The box of the target is (50, 10, 60, 10); expected an area."),
        (with_box(5, 50, 10, 53.9, 60), "box is smaller than 4 px", "boxes.csv, sequence 1",
         "The box of frame 5 is (50, 10, 53.9, 60); expected sides of at least 4 px."),
        (with_box(0, 160, 10, 200, 60), "box lies outside the image", "boxes.csv, sequence 1",
         "The box of frame 0 is (160, 10, 200, 60); expected one inside of 160×96 px."),
        (with_image(3, Path.unlink), "image is missing", JPG,
         "The image is missing; expected frame 3 of the sequence 1, as .jpg or .png."),
        (with_image(3, move_by_a_millisecond), "frames are not 0.1 s apart", JPG,
         f"The image is missing; the nearest one is {stamp(1, 3) + 1_000_000}, +1.0 ms off; "
         "expected frame 3 of the sequence 1, whose frames are exactly 100,000,000 ns apart."),
        (with_image(3, lambda path: path.write_bytes(b"")), "image cannot be decoded", JPG,
         "The file is empty; expected a whole JPEG or PNG image."),
        (with_image(3, lambda path: path.write_bytes(b"no image")), "image cannot be decoded", JPG,
         "The file is not an image that OpenCV decodes; expected a whole JPEG or PNG image."),
        (with_image(3, lambda path: write_image(path, picture(1, 3, size=(80, 48)))),
         "image has another size", JPG,
         "The image has 80×48 pixels; expected 160×96 as in the target frame of its sequence."),
    ],
)  # fmt: skip
def test_a_fault_of_one_sequence_takes_its_fallback_and_is_counted(
    folder: Path, spoil: Spoil, reason: str, where: str, message: str
) -> None:
    spoil(folder)
    done = estimate(folder)
    assert done.n_fallback == {reason: 1}
    assert (done.examples[reason].where, done.examples[reason].message) == (where, message)
    has_no_box = "boxes" in where and reason not in {"box is smaller than 4 px", "box lies outside the image"}
    boxes = read_folder(folder).boxes[1]
    assert done.scale_ratio[1] == (1.0 if has_no_box else root_of_areas(boxes[0], boxes[5]))
    assert done.meta["n_fallback"] == {reason: 1}

    (folder.parent / "p.json").unlink()
    with pytest.raises(Rejected) as rejected:
        estimate(folder, strict=True)
    [problem] = rejected.value.problems
    assert (problem.where, problem.message) == (where, message)
    assert "p.json" not in names(folder)


def test_a_strict_run_names_every_missing_box_and_image_before_it_begins(folder: Path) -> None:
    write_boxes(folder, n=N, changes={(0, 5): ()})
    image_path(folder, 1, 3).unlink()
    image_path(folder, 2, 0).unlink()
    with pytest.raises(Rejected) as rejected:
        estimate(folder, strict=True)
    assert [problem.where for problem in rejected.value.problems] == [
        "boxes.csv, sequence 0",
        JPG,
        f"images/0007/cam1/{stamp(2, 0)}.jpg",
    ]
    assert names(folder) == set()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "suffix"), [(cut_off, ".jpg"), (cut_off_png, ".png")], ids=["JPEG", "PNG"]
)
def test_an_image_that_is_cut_off_is_not_taken_for_a_whole_one(
    folder: Path, change: Callable[[Path], object], suffix: str
) -> None:
    with_image(3, change)(folder)
    [(reason, problem)] = estimate(folder).examples.items()
    assert reason == "image cannot be decoded"
    assert problem.where.endswith(suffix)
    assert "inside a " in problem.message


@pytest.mark.slow
def test_what_a_method_cannot_say_and_where_it_fails_take_the_fallback(folder: Path) -> None:
    done = estimate(folder, refused=0, broken=2)
    assert done.n_fallback == {"box has no texture": 1, "the method failed with ZeroDivisionError": 1}
    assert str(done.examples["box has no texture"]) == (
        "sequence 0: Box has no texture; expected an estimate."
    )
    assert done.scale_ratio[[0, 2]].tolist() == [root_of_areas(box(0), box(5))] * 2


def test_an_estimate_that_no_file_may_hold_takes_the_fallback(folder: Path) -> None:
    with pytest.raises(Rejected, match=r"3 of 3 sequences .*: The estimate is -0\.5; expected a finite"):
        estimate(folder, constant=-0.5)


# --- interrupted runs ------------------------------------------------------------------------------------


class Ended(Exception):
    """Ends a run from outside, as Ctrl-C does."""


def end_after(n_sequences: int) -> Callable[[int], None]:
    def progress(n_done: int) -> None:
        if n_done >= n_sequences:
            raise Ended

    return progress


@pytest.mark.slow
def test_an_ended_run_continues_and_gives_the_same_file(folder: Path) -> None:
    estimate(folder, out="whole.json")
    with pytest.raises(Ended):
        estimate(folder, progress=end_after(2))
    assert names(folder) == {"whole.json", "p.json.part"}
    with (folder.parent / "p.json.part").open("ab") as journal:
        journal.write(b'{"values":[[2,')  # as it is when a machine stops in the midst of a line
    assert estimate(folder).n_resumed == 2
    assert names(folder) == {"whole.json", "p.json"}
    assert (folder.parent / "p.json").read_bytes() == (folder.parent / "whole.json").read_bytes()


@pytest.mark.slow
def test_a_fallback_of_the_ended_run_is_estimated_again(folder: Path) -> None:
    path = image_path(folder, 1, 3)
    path.rename(folder / "aside")
    with pytest.raises(Ended):
        estimate(folder, progress=end_after(3))
    (folder / "aside").rename(path)
    done = estimate(folder)
    assert (done.n_resumed, done.n_fallback) == (2, {})


@pytest.mark.slow
@pytest.mark.parametrize(
    "change", [{"power": 2.0}, {"frame_gap": 4}, {"boxes": True}], ids=["parameter", "gap", "boxes"]
)
def test_a_run_with_anything_else_begins_again(folder: Path, change: dict[str, Any]) -> None:
    with pytest.raises(Ended):
        estimate(folder, progress=end_after(2))
    if change.pop("boxes", False):
        write_boxes(folder, n=N, changes={(0, 0): (1, 1, 30, 30)})
    assert estimate(folder, **change).n_resumed == 0


# --- several processes -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_several_processes_give_the_same_file_as_one(folder: Path) -> None:
    made_folder(folder, n=20)
    image_path(folder, 1, 3).unlink()
    estimate(folder, out="one.json")
    reported: list[int] = []
    estimate(folder, out="two.json", n_processes=2, progress=reported.append)
    assert (folder.parent / "two.json").read_bytes() == (folder.parent / "one.json").read_bytes()
    assert reported[-1] == 20
    assert len(reported) > 2
