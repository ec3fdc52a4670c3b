"""The downloaded dataset is read without a conversion."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evaluator import Manifest, Rejected, read_manifest, read_predictions
from evaluator.truth.ground_truth import KeyKind
from tests.evaluator.toolkit_folders import START_NS, STEP_NS, camera, foreign_class, write_folder
from tests.tsttc_baselines.made_folders import GREY_LEVELS, SIZE, box, picture, write_image
from tsttc_baselines.folders import read_folder
from tsttc_baselines.images import ImageCache
from tsttc_baselines.running import run_method

N_FRAMES = 13
"""Two sequences, and a frame that begins a third."""


def box2d(frame: int) -> list[float]:
    return (np.array(box(frame % 6)) / [*SIZE, *SIZE]).tolist()


def download(folder: Path, *, as_array: bool = False, **changes: Any) -> Path:
    """A recording: its annotation file, and its folder of images next to it."""
    with foreign_class("easydict.EasyDict") as make:
        frames = camera({7: [*range(N_FRAMES)]}, make, bag_stamp="/data/bags/0007")
        for frame, [seen] in enumerate(frames.values()):
            numbers = box2d(frame)
            seen.update({"box2d": np.array(numbers) if as_array else numbers} | changes)
            seen.__dict__.update(seen)
        write_folder(folder, {"0007.pkl": [frames]})
    for frame in range(N_FRAMES):
        write_image(folder / "0007" / "cam1" / f"{START_NS + frame * STEP_NS}.jpg", picture(0, frame))
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("as_array", [False, True], ids=["list", "array"])
def test_boxes_and_frames_are_those_of_the_annotation_files(tmp_path: Path, as_array: bool) -> None:
    folder = read_folder(download(tmp_path, as_array=as_array))
    assert folder.manifest.digest == read_manifest(tmp_path).digest
    assert folder.n_sequences == 2
    clip = folder.clip(1, cache=ImageCache())
    np.testing.assert_allclose(clip.boxes, [box(frame) for frame in range(6)], rtol=1e-12)
    assert np.abs(clip.colour(0).astype(int) - picture(0, 6)).mean() < 4


def run_on(folder: Path, *, keys: KeyKind = "natural_key") -> bytes:
    """The file of a run over this folder."""
    out = folder / "p.json"
    done = run_method(
        folder=read_folder(folder), method=GREY_LEVELS, parameters={}, frame_gap=5, out=out, keys=keys
    )
    assert done.n_fallback == {}
    return out.read_bytes()


@pytest.mark.slow
def test_a_run_over_a_download_is_a_file_for_any_manifest_of_its_sequences(tmp_path: Path) -> None:
    folder = download(tmp_path)
    own = read_manifest(folder)
    data = run_on(folder)
    assert list(json.loads(data)["predictions"]) == list(own.natural_keys)
    write_renumbered(folder, own)
    board = read_manifest(folder / "manifest.csv")
    np.testing.assert_array_equal(
        read_predictions(data, manifest=board).ttc_s, read_predictions(data, manifest=own).ttc_s[::-1]
    )


@pytest.mark.slow
def test_a_manifest_beside_the_files_gives_the_order_and_the_anno_ids_that_are_asked_for(
    tmp_path: Path,
) -> None:
    folder = download(tmp_path)
    own = read_manifest(folder)
    write_renumbered(folder, own)
    assert list(json.loads(run_on(folder))["predictions"]) == list(own.natural_keys)[::-1]
    assert list(json.loads(run_on(folder, keys="anno_id"))["predictions"]) == ["50", "40"]


def write_renumbered(folder: Path, own: Manifest) -> None:
    """A `manifest.csv` of the same two sequences in the reverse order, as 50 and 40."""
    header, *rows = own.to_csv().decode().splitlines()
    renumbered = [
        f"{anno_id},{row.partition(',')[2]}" for anno_id, row in zip((50, 40), rows[::-1], strict=True)
    ]
    (folder / "manifest.csv").write_text("\n".join([header, *renumbered, ""]))


@pytest.mark.slow
def test_a_manifest_of_other_sequences_is_refused(tmp_path: Path) -> None:
    folder = download(tmp_path)
    text = read_manifest(folder).to_csv().decode()
    (folder / "manifest.csv").write_text(text.replace(",0007,", ",0008,"))
    with pytest.raises(Rejected) as rejected:
        read_folder(folder)
    assert {problem.code for problem in rejected.value.problems} == {"missing-keys", "unknown-keys"}


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [None, [0.1, 0.2, 0.3], "four", [0.1, 0.2, 0.3, None], np.zeros((3, 4))])
def test_an_object_without_a_box_is_refused_with_its_position(tmp_path: Path, wrong: object) -> None:
    with pytest.raises(Rejected) as rejected:
        read_folder(download(tmp_path, box2d=wrong))
    problem = rejected.value.problems[0]
    assert (problem.code, problem.where) == ("bad-field", "0007.pkl, sequence 0")
    assert problem.message.startswith("box2d is ")
    assert "expected four numbers, x1, y1, x2 and y2. 1 more place has this problem" in problem.message
    assert read_manifest(tmp_path).n_sequences == 2, "whoever wants no boxes does without"
