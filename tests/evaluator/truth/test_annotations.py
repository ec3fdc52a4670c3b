"""Ground truth from the toolkit's annotation folders."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evaluator import Rejected, read_manifest, read_truth
from tests.evaluator.toolkit_folders import (
    FOREIGN_CLASSES,
    START_NS,
    STEP_NS,
    camera,
    foreign_class,
    seen,
    write_folder,
)

SIX = list(range(6))


@pytest.fixture(autouse=True)
def _without_a_child(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read here, as where a process has no limits; `test_annotation_folders` reads in the child."""
    monkeypatch.setattr("evaluator.truth.annotation_folders.HAS_LIMITS", False)


def last_frames(folder: Path) -> list[tuple[str, int]]:
    """Track and frame of every target."""
    manifest = read_truth(folder).manifest
    frames = ((manifest.ts_ns - START_NS) // STEP_NS).tolist()
    return list(zip(manifest.track_id, frames, strict=True))


def rejection(folder: Path, *, manifest_only: bool = False) -> Rejected:
    with pytest.raises(Rejected) as rejected:
        (read_manifest if manifest_only else read_truth)(folder)
    return rejected.value


@pytest.mark.parametrize("protocol", range(6))
@pytest.mark.parametrize("name", FOREIGN_CLASSES)
def test_attribute_dicts_of_any_class_are_read_without_it(tmp_path: Path, name: str, protocol: int) -> None:
    with foreign_class(name) as make:
        write_folder(tmp_path, {"0007.pkl": [camera({7: SIX}, make)]}, protocol=protocol)
    truth = read_truth(tmp_path)
    assert truth.manifest.natural_keys == ("0007/1/1600000000500000000/7",)
    assert truth.ttc_s.tolist() == [9.5]


def test_sequences_are_cut_without_overlap(tmp_path: Path) -> None:
    write_folder(tmp_path, {"a.pkl": [camera({7: list(range(17))})]})
    assert last_frames(tmp_path) == [("7", 5), ("7", 11)]


def test_a_skipped_frame_starts_the_sequence_again(tmp_path: Path) -> None:
    write_folder(tmp_path, {"a.pkl": [camera({7: [0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11], 8: list(range(12))})]})
    assert last_frames(tmp_path) == [("8", 5), ("7", 11), ("8", 11)]


def test_frames_one_nanosecond_off_are_no_sequence(tmp_path: Path) -> None:
    frames = camera({7: SIX, 8: SIX})
    frames[START_NS + 3 * STEP_NS][0]["ts"] += 1
    write_folder(tmp_path, {"a.pkl": [frames]})
    assert last_frames(tmp_path) == [("8", 5)]


def test_sequences_that_end_together_keep_the_order_of_their_tracks(tmp_path: Path) -> None:
    # The toolkit goes by when a track was first seen since its last complete sequence.
    write_folder(tmp_path, {"a.pkl": [camera({9: [0, *range(2, 8)], 3: range(2, 8)})]})  # type: ignore[dict-item]
    assert last_frames(tmp_path) == [("9", 7), ("3", 7)]


def test_cameras_are_cut_apart(tmp_path: Path) -> None:
    write_folder(tmp_path, {"a.pkl": [camera({7: SIX}), {}, camera({7: SIX}, cam_id=8)]})
    assert read_truth(tmp_path).manifest.cam_id == ("1", "8")


def test_anno_ids_are_numbered_over_files_sorted_by_path(tmp_path: Path) -> None:
    files = {
        f"{name}.pkl": [camera({7: SIX}, bag_stamp=name.replace("/", "-"))]
        for name in ("b", "a10", "a2", "a/z", "c")
    }
    write_folder(tmp_path, files)
    (tmp_path / "a" / "cam1").mkdir()
    (tmp_path / "notes.txt").write_text("not an annotation file")
    manifest = read_truth(tmp_path).manifest
    assert manifest.anno_id.tolist() == [0, 1, 2, 3, 4]
    assert manifest.bag_stamp == ("a-z", "a10", "a2", "b", "c")


def test_a_public_test_set_without_true_times_has_a_manifest_but_no_truth(tmp_path: Path) -> None:
    frames = camera({7: SIX})
    for objects in frames.values():
        for one in objects:
            del one["ttc_imu"]
    write_folder(tmp_path, {"a.pkl": [frames]})
    assert read_manifest(tmp_path).n_sequences == 1
    problem = rejection(tmp_path).problems[0]
    assert (problem.code, problem.where) == ("bad-field", "a.pkl, sequence 0")
    assert problem.message == "ttc_imu is absent; expected a number of seconds."


@pytest.mark.parametrize(
    ("ttc_s", "code"),
    [
        (0.0, "truth-near-zero"),
        (-0.05, "truth-near-zero"),
        (math.nan, "bad-field"),
        (np.inf, "bad-field"),
        ("5", "bad-field"),
    ],
)
def test_true_times_without_errors_are_refused(tmp_path: Path, ttc_s: object, code: str) -> None:
    write_folder(tmp_path, {"a.pkl": [camera({7: SIX}, ttc_imu=ttc_s)]})
    assert [(p.code, p.where) for p in rejection(tmp_path).problems] == [(code, "a.pkl, sequence 0")]


def test_the_same_target_twice_is_refused(tmp_path: Path) -> None:
    write_folder(tmp_path, {"a.pkl": [camera({7: SIX})], "b.pkl": [camera({7: SIX})]})
    problem = rejection(tmp_path, manifest_only=True).problems[0]
    assert (problem.code, problem.where) == ("duplicate-natural-keys", "b.pkl, sequence 1")


def without(name: str) -> list[dict[int, list[Any]]]:
    one = seen(frame=0)
    del one[name]
    return [{START_NS: [one]}]


@pytest.mark.parametrize(
    ("content", "structure"),
    [
        ({}, "a dict"),
        ([[]], "a list in place of a camera"),
        ([{"0": []}], "a timestamp that is not a number"),
        ([{0: {}}], "a dict in place of a frame's objects"),
        ([{0: [5]}], "a int in place of an object"),
        (without("ts"), "an object without ts"),
        ([{0: [seen(frame=0, bag_stamp=7)]}], "an object whose bag_stamp is not text"),
        ([{0: [seen(frame=0, id=1.5)]}], "an object whose id is neither a whole number nor a text"),
        ([{0: [seen(frame=0, ts=1.5)]}], "an object whose ts is not a whole number of nanoseconds"),
        ([{0: [seen(frame=0, ts=-1)]}], "an object whose ts is not a whole number of nanoseconds"),
        (
            [{10**18: [seen(frame=0, id=10**5000)]}],
            "an object whose id is neither a whole number nor a text",
        ),
    ],
)
def test_files_of_another_structure_are_refused(tmp_path: Path, content: object, structure: str) -> None:
    write_folder(tmp_path, {"sub/a.pkl": content})
    problem = rejection(tmp_path).problems[0]
    assert (problem.code, problem.where) == ("bad-annotations", "sub/a.pkl")
    assert problem.message == (
        f"The file holds {structure}; expected a list of dictionaries, one per camera, "
        "from timestamp to list of attribute-dicts."
    )


@pytest.mark.parametrize("changes", [{"bag_stamp": "x/"}, {"id": "a,b"}, {"cam_id": ""}, {"id": " 7"}])
def test_names_that_no_table_can_hold_are_refused(tmp_path: Path, changes: dict[str, Any]) -> None:
    write_folder(tmp_path, {"a.pkl": [camera({7: SIX}, **changes)]})
    assert [problem.code for problem in rejection(tmp_path).problems] == ["bad-field"]


def test_a_frame_mentioned_many_times_in_many_cameras_is_not_walked_that_often(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("evaluator.truth.annotations.MAX_OBJECTS", 2_000)
    objects = [seen(frame=0)] * 500
    write_folder(tmp_path, {"a.pkl": [dict.fromkeys(range(500), objects)] * 1_000_000})
    assert "more than 2,000 objects" in rejection(tmp_path).problems[0].message
