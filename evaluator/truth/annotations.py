"""The toolkit's annotation files: untrusted pickles, read without running them.

A file is a list of dictionaries, one per camera: timestamp -> list of attribute-dicts with `bag_stamp, box2d,
cam_id, id, occ_ratio, same_lane, ts, ttc_imu`. A sequence is six frames of one id, exactly 0.1 s apart,
without overlap; its target is the last frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Final, cast

from evaluator.metrics.scale import N_FRAMES
from evaluator.problems import Findings, quoted, reject
from evaluator.truth.csv_tables import Table, name_fault
from evaluator.truth.objects import is_box, plain_occ_ratio, plain_same_lane
from evaluator.truth.pickles import Attributes, FewNumbers, load_plain

Camera = dict[float, list[Attributes]]
"""The objects that one camera sees, by timestamp."""


@dataclass(frozen=True, slots=True)
class AnnotatedFiles:
    """The sequences of some files in order, one row each, and the number in each file.

    `listed` are indices of the sorted files, in the file system's order. On request, `boxes` has x1, y1, x2,
    y2 of all six frames (parts of the image's width and height), `frame_ttc_s` their times in seconds, NaN if
    absent.
    """

    table: Table
    n_sequences: list[int]
    listed: list[int] = field(default_factory=list)
    boxes: list[list[float]] = field(default_factory=list)
    frame_ttc_s: list[list[float]] = field(default_factory=list)


FRAME_STEP_NS: Final = 100_000_000
MAX_OBJECTS: Final = 2_000_000
"""A limit for one annotation file, far above that of a recording of minutes."""

_MAX_STAMP: Final = 4_096


def read_files(
    files: Iterable[tuple[str, bytes]],
    *,
    with_ttc: bool,
    with_boxes: bool = False,
    with_frames: bool = False,
) -> AnnotatedFiles:
    """Read the sequences of annotation files, by name and content, as `read_annotations` does."""
    table, findings, locations, n_sequences = Table(), Findings(), list[str](), list[int]()
    boxes, frame_ttc_s = list[list[float]](), list[list[float]]()
    for name, data in files:
        first = len(locations)
        for camera in _cameras(data, name):
            for sequence in cut_sequences(camera):
                locations.append(f"{name}, sequence {len(locations)}")
                _add_row(table, sequence[-1], findings, locations[-1], with_ttc=with_ttc)
                if with_boxes:
                    boxes.append([x for seen in sequence for x in _box(seen, findings, locations[-1])])
                if with_frames:
                    frame_ttc_s.append([_ttc_s(seen) for seen in sequence])
        n_sequences.append(len(locations) - first)
    findings.raise_if_any()
    table.locations = locations
    return AnnotatedFiles(table, n_sequences, boxes=boxes, frame_ttc_s=frame_ttc_s)


def cut_sequences(camera: Camera, *, n_frames: int = N_FRAMES) -> Iterator[list[Attributes]]:
    """Cut one camera's sequences in the toolkit's order: by completing frame, then by track."""
    # A gap restarts a track. A complete sequence shares no frame with the next one.
    open_tracks: dict[object, list[Attributes]] = {}
    for stamp in sorted(camera):
        for seen in camera[stamp]:
            track = open_tracks.get(seen["id"])
            if track is not None and seen["ts"] - track[-1]["ts"] == FRAME_STEP_NS:
                track.append(seen)
            else:
                open_tracks[seen["id"]] = [seen]
        complete = [track_id for track_id, track in open_tracks.items() if len(track) == n_frames]
        for track_id in complete:
            yield open_tracks.pop(track_id)


def _cameras(data: bytes, name: str) -> list[Camera]:
    cameras = load_plain(data, where=name)
    fault = _structure_fault(cameras)
    if fault:
        expected = "a list of dictionaries, one per camera, from timestamp to list of attribute-dicts"
        raise reject("bad-annotations", f"The file holds {fault}; expected {expected}.", name)
    return cast("list[Camera]", cameras)


def _structure_fault(cameras: object) -> str | None:
    if not isinstance(cameras, list):
        return f"a {type(cameras).__name__}"
    n_objects = 0
    for camera in cameras:
        if not isinstance(camera, dict):
            return f"a {type(camera).__name__} in place of a camera"
        for stamp, frame in camera.items():
            if fault := _frame_fault(stamp, frame):
                return fault
            # A pickle may mention one frame a million times, in a camera that it mentions a million times.
            n_objects += len(frame) + 1
            if n_objects > MAX_OBJECTS:
                return f"more than {MAX_OBJECTS:,} objects"
    return None


def _frame_fault(stamp: object, frame: object) -> str | None:
    if not isinstance(stamp, int) and not (isinstance(stamp, float) and math.isfinite(stamp)):
        return "a timestamp that is not a number"
    if not isinstance(frame, list):
        return f"a {type(frame).__name__} in place of a frame's objects"
    return next(filter(None, map(_object_fault, frame)), None)


def _object_fault(seen: object) -> str | None:
    if not isinstance(seen, dict):
        return f"a {type(seen).__name__} in place of an object"
    for name in ("bag_stamp", "cam_id", "id", "ts"):
        if name not in seen:
            return f"an object without {name}"
    if fault := _stamp_fault(seen["bag_stamp"]):
        return fault
    for name in ("cam_id", "id"):
        if not isinstance(seen[name], str) and not _is_whole(seen[name]):
            return f"an object whose {name} is neither a whole number nor a text"
    if not _is_whole(seen["ts"]) or seen["ts"] < 0:
        return "an object whose ts is not a whole number of nanoseconds"
    return None


def _stamp_fault(stamp: object) -> str | None:
    if not isinstance(stamp, str):
        return "an object whose bag_stamp is not text"
    if len(stamp) > _MAX_STAMP:  # a part of it is copied for each sequence
        return f"an object whose bag_stamp is longer than {_MAX_STAMP:,} characters"
    return None


def _is_whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) < 2**63


def _add_row(table: Table, target: Attributes, findings: Findings, where: str, *, with_ttc: bool) -> None:
    names = {
        # The toolkit takes the last part of a path.
        "bag_stamp": str(target["bag_stamp"]).rsplit("/", 1)[-1],
        "cam_id": str(target["cam_id"]),
        "id": str(target["id"]),
    }
    for name, text in names.items():
        if fault := name_fault(text):
            findings.add("bad-field", f"{name} is {quoted(text)}: {fault}.", where)
    table.anno_id.append(len(table.anno_id))
    table.bag_stamp.append(names["bag_stamp"])
    table.cam_id.append(names["cam_id"])
    table.track_id.append(names["id"])
    table.ts_ns.append(target["ts"])
    if not with_ttc:
        return
    ttc_s = target.get("ttc_imu")
    if isinstance(ttc_s, int | float) and abs(ttc_s) < 1e308:
        table.ttc_s.append(float(ttc_s))
    else:
        kind = "absent" if ttc_s is None else f"a {type(ttc_s).__name__}"
        findings.add("bad-field", f"ttc_imu is {kind}; expected a number of seconds.", where)
    # No score depends on these: a file that states something else for them is scored all the same.
    table.occ_ratio.append(plain_occ_ratio(target.get("occ_ratio")))
    table.same_lane.append(plain_same_lane(target.get("same_lane")))
    box = _numbers(target.get("box2d"))
    table.box2d.append(box if box and is_box(box) else None)


def _ttc_s(seen: Attributes) -> float:
    ttc_s = seen.get("ttc_imu")
    return float(cast("float", ttc_s)) if _is_number(ttc_s) else math.nan


def _box(seen: Attributes, findings: Findings, where: str) -> list[float]:
    box = seen.get("box2d")
    numbers = _numbers(box)
    if numbers is not None:
        return numbers
    kind = "absent" if box is None else f"a {type(box).__name__} of other content"
    findings.add("bad-field", f"box2d is {kind}; expected four numbers, x1, y1, x2 and y2.", where)
    return [math.nan] * 4


def _numbers(box: object) -> list[float] | None:
    numbers = box.numbers if isinstance(box, FewNumbers) else box
    if isinstance(numbers, list | tuple) and len(numbers) == 4 and all(map(_is_number, numbers)):
        return [float(number) for number in numbers]
    return None


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e308
