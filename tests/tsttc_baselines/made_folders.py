"""Small folders of the convention with made-up images, and estimators that look at them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from tests.tsttc_baselines.real_folders import FRAME_NS
from tsttc_baselines.clips import TARGET, Clip
from tsttc_baselines.estimates import Estimate, Unusable
from tsttc_baselines.methods import Method, Parameter

SIZE = (160, 96)
START_NS = 1_600_000_000_000_000_000
N = 3

Boxes = Mapping[tuple[int, int], Sequence[float]]


def stamp(anno_id: int, frame: int) -> int:
    """The timestamp of a frame: sequences of one recording follow each other."""
    return START_NS + (6 * anno_id + frame) * FRAME_NS


def image_path(folder: Path, anno_id: int, frame: int, *, extension: str = "jpg") -> Path:
    return folder / "images" / "0007" / "cam1" / f"{stamp(anno_id, frame)}.{extension}"


def box(frame: int) -> tuple[float, float, float, float]:
    """A box that grows by 2 px a frame."""
    return (50.0 - frame, 30.0 - frame, 90.0 + frame, 60.0 + frame)


def write_manifest(folder: Path, *, n: int = N) -> None:
    rows = [f"{anno_id},0007,1,{stamp(anno_id, TARGET)},{anno_id}" for anno_id in range(n)]
    (folder / "manifest.csv").write_text("\n".join(["anno_id,bag_stamp,cam_id,ts,track_id", *rows, ""]))


def write_boxes(folder: Path, *, n: int = N, changes: Boxes | None = None, head: str = "") -> None:
    """All boxes; `changes` by anno_id and frame, an empty one for a row that is left out."""
    lines = ["anno_id,frame,x1,y1,x2,y2"]
    for anno_id in range(n):
        for frame in range(6):
            values = (changes or {}).get((anno_id, frame), box(frame))
            if values:
                lines.append(f"{anno_id},{frame},{','.join(map(str, values))}")
    (folder / "boxes.csv").write_text("\n".join([*([head] if head else []), *lines, ""]))


def picture(anno_id: int, frame: int, *, size: tuple[int, int] = SIZE) -> np.ndarray:
    rng = np.random.default_rng([anno_id, frame])
    coarse = rng.integers(0, 256, (6, 10, 3), dtype=np.uint8)  # smooth, so that a JPEG is like it
    return np.asarray(cv2.resize(coarse, size), dtype=np.uint8)


def write_image(path: Path, image: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(cv2.imencode(path.suffix, image)[1].tobytes())


def made_folder(folder: Path, *, n: int = N, extension: str = "jpg") -> Path:
    """`n` sequences of one camera, all in order."""
    write_manifest(folder, n=n)
    write_boxes(folder, n=n)
    for anno_id in range(n):
        for frame in range(6):
            write_image(image_path(folder, anno_id, frame, extension=extension), picture(anno_id, frame))
    return folder


@dataclass(frozen=True)
class GreyLevels:
    """The ratio of two frames' mean grey levels: no estimate, but one that needs both images."""

    power: float = 1.0
    constant: float = 0.0
    refused: int = -1
    broken: int = -1

    def __call__(self, clip: Clip, *, frame_gap: int) -> Estimate:
        if clip.anno_id == self.refused:
            raise Unusable("box has no texture")
        if clip.anno_id == self.broken:
            raise ZeroDivisionError("a mistake")
        if self.constant:
            return Estimate(self.constant)
        means = [float(clip.grey(frame).mean()) for frame in range(TARGET - frame_gap, TARGET + 1)]
        return Estimate((means[0] / means[-1]) ** self.power)


GREY_LEVELS = Method(
    name="grey-levels",
    title="Grey levels",
    summary="A method of the tests.",
    factory="tests.tsttc_baselines.made_folders:GreyLevels",
    parameters=(
        Parameter("power", 1.0, "Power.", kind=float),
        Parameter("constant", 0.0, "The estimate of every sequence.", kind=float),
        Parameter("refused", -1, "Sequence without an estimate.", kind=int),
        Parameter("broken", -1, "Sequence at which it fails.", kind=int),
    ),
    frames="all",
)
