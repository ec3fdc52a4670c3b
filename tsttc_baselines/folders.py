"""Folders of sequences: `manifest.csv`, `boxes.csv` and images, or the downloaded dataset.

    manifest.csv                              anno_id,bag_stamp,cam_id,ts,track_id, as a split publishes it
    boxes.csv                                 anno_id,frame,x1,y1,x2,y2; frame 0…5, pixels
    images/{bag_stamp}/cam{cam_id}/{ts}.jpg   or .png, or without `images/`

A sequence's target is frame 5 at its own ts; frame 5 − k has the timestamp ts − k·10⁸ ns.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluator.problems import Problem, Rejected, reject
from evaluator.truth.annotation_folders import list_files, read_annotations
from evaluator.truth.annotations import FRAME_STEP_NS
from evaluator.truth.ground_truth import GroundTruth, Manifest, read_manifest, read_truth
from evaluator.truth.numbering import require_the_same
from tsttc_baselines.box_tables import read_boxes
from tsttc_baselines.clips import TARGET, Clip, Image
from tsttc_baselines.estimates import SequenceFault
from tsttc_baselines.images import ImageCache

EXTENSIONS: Final = (".jpg", ".png", ".jpeg")
NOMINAL_SIZE: Final = (1024, 576)
"""Width and height in pixels on which boxes of 0…1 are taken where no image is looked at."""

MANIFEST: Final = "manifest.csv"
BOXES: Final = "boxes.csv"
IMAGES: Final = "images"
TRUTH: Final = "truth.csv"
"""The ground truth of a folder, as `tsttc baseline render` writes it."""


@dataclass(frozen=True, eq=False)
class SequenceFolder:
    """The sequences of a folder, in the order of its manifest.

    - `path`: the folder.
    - `images`: the folder that has one folder for each recording.
    - `manifest`: the list of the sequences.
    - `boxes`: an array of shape (n, 6, 4), for each sequence the boxes of its six frames as x1, y1, x2, y2. A
      missing box is NaN.
    - `boxes_from`: what the boxes were read from: "boxes.csv" or "annotation files".
    - `is_normalised`: true if boxes are parts of the image's width and height, false if they are pixels.
    """

    path: Path
    images: Path
    manifest: Manifest
    boxes: NDArray[np.float64]
    boxes_from: str
    is_normalised: bool

    @property
    def n_sequences(self) -> int:
        """Number of sequences."""
        return self.manifest.n_sequences

    def digest(self) -> str:
        """Return the SHA-256 of the sequences and their boxes, as hexadecimal text."""
        content = hashlib.sha256(f"{self.manifest.digest} {self.is_normalised}".encode())
        content.update(np.ascontiguousarray(self.boxes).tobytes())
        return content.hexdigest()

    def rows_in_time(self) -> NDArray[np.intp]:
        """Return all rows, ordered by recording, camera and time."""
        # Sequences that share frames follow each other.
        manifest = self.manifest
        return np.lexsort((manifest.ts_ns, np.array(manifest.cam_id), np.array(manifest.bag_stamp)))

    def frame_path(self, row: int, frame: int) -> Path:
        """Return the path of a frame, 0 to 5. If there is no file, the path ends in .jpg."""
        camera = self.images / self.manifest.bag_stamp[row] / f"cam{self.manifest.cam_id[row]}"
        ts_ns = int(self.manifest.ts_ns[row]) - (TARGET - frame) * FRAME_STEP_NS
        paths = [camera / f"{ts_ns}{extension}" for extension in EXTENSIONS]
        return next((path for path in paths if path.exists()), paths[0])

    def where(self, path: Path) -> str:
        """Return a path as messages show it: relative to the folder if it lies inside."""
        return path.relative_to(self.path).as_posix() if path.is_relative_to(self.path) else str(path)

    def clip(self, row: int, *, cache: ImageCache, with_images: bool = True) -> Clip:
        """Return the clip of a row, with boxes in pixels. A frame is decoded when it is first used.

        Boxes of 0…1 need the target's image size, or `NOMINAL_SIZE` without images. Raises `SequenceFault`
        for a missing or faulty image, then or on access.
        """
        boxes = self.boxes[row]
        if self.is_normalised:
            size = self.size(row, cache=cache) if with_images else NOMINAL_SIZE
            boxes = boxes * np.array([*size, *size], dtype=np.float64)

        paths: dict[int, Path] = {}

        def load(frame: int, colour: bool) -> Image:
            for each in {frame, TARGET} - paths.keys():
                paths[each] = self.existing_path(row, each)
            return self._image(paths[frame], like=paths[TARGET], colour=colour, cache=cache)

        return Clip(anno_id=int(self.manifest.anno_id[row]), boxes=boxes, load=load)

    def size(self, row: int, *, cache: ImageCache) -> tuple[int, int]:
        """Return the width and height of the target frame in pixels. Raises `SequenceFault`."""
        path = self.existing_path(row, TARGET)
        return cache.size(path, where=self.where(path))

    def _image(self, path: Path, *, like: Path, colour: bool, cache: ImageCache) -> Image:
        image = cache.image(path, colour=colour, where=self.where(path))
        expected = cache.size(like, where=self.where(like))
        size = (image.shape[1], image.shape[0])
        if size != expected:
            message = (
                f"The image has {size[0]}×{size[1]} pixels; "
                f"expected {expected[0]}×{expected[1]} as in the target frame of its sequence."
            )
            raise SequenceFault("image has another size", Problem("bad-frame", message, self.where(path)))
        return image

    def existing_path(self, row: int, frame: int) -> Path:
        """Return the path of a frame, 0 to 5. Raises `SequenceFault` if there is no file."""
        path = self.frame_path(row, frame)
        if not path.exists():
            reason, message = self._why_missing(row, frame, path)
            raise SequenceFault(reason, Problem("bad-frame", message, self.where(path)))
        return path

    def _why_missing(self, row: int, frame: int, path: Path) -> tuple[str, str]:
        sequence = f"frame {frame} of the sequence {self.manifest.anno_id[row]}"
        stamps = sorted(
            int(other.stem)
            for other in path.parent.glob("*")
            if other.suffix in EXTENSIONS and other.stem.isdecimal()
        )
        if not stamps:
            expected = f"expected {sequence}, as .jpg or .png"
            return "image is missing", f"The image is missing, its folder has none; {expected}."
        ts_ns = int(path.stem)
        nearest = min(stamps, key=lambda stamp: abs(stamp - ts_ns))
        if abs(nearest - ts_ns) < FRAME_STEP_NS // 2:
            message = (
                f"The image is missing; the nearest one is {nearest}, {(nearest - ts_ns) / 1e6:+.1f} ms off; "
                f"expected {sequence}, whose frames are exactly 100,000,000 ns apart."
            )
            return "frames are not 0.1 s apart", message
        if ts_ns < stamps[0]:
            n_frames = sum(self.frame_path(row, other).exists() for other in range(frame, TARGET + 1))
            message = (
                "The image is missing, and no frame of this camera is so early; expected "
                f"{sequence}, which has {n_frames} of the frames {frame} to {TARGET}."
            )
            return "too few frames", message
        return "image is missing", f"The image is missing; expected {sequence}, as .jpg or .png."


def read_folder(path: str | os.PathLike[str]) -> SequenceFolder:
    """Read a folder that `tsttc baseline run` takes: tables and images, or the downloaded dataset.

    `path` is the folder. Raises `Rejected` if it has another form, or if a table or an annotation file
    has an error. Images are checked when they are used.
    """
    path = Path(path)
    root = path / IMAGES if (path / IMAGES).is_dir() else path
    if (path / BOXES).is_file():
        if not (path / MANIFEST).is_file():
            message = (
                f"The folder has a {BOXES} and no {MANIFEST}; expected the manifest of the split beside it."
            )
            raise reject("unreadable", message, path.name)
        manifest = _manifest(path)
        boxes, is_normalised = read_boxes(path / BOXES, manifest=manifest)
        return SequenceFolder(path, root, manifest, boxes, BOXES, is_normalised)
    given = _manifest(path) if (path / MANIFEST).is_file() else None
    annotated = read_toolkit_folder(path, manifest=given)
    if annotated is None:
        expected = f"expected {MANIFEST} and {BOXES}, or the dataset's annotation files (*.pkl)"
        missing = f"no {BOXES} and no" if given is not None else f"neither {MANIFEST} with {BOXES} nor"
        raise reject("unreadable", f"The folder has {missing} annotation files; {expected}.", path.name)
    manifest, boxes = annotated
    return SequenceFolder(path, root, manifest, boxes, "annotation files", is_normalised=True)


def read_folder_truth(path: Path) -> GroundTruth:
    """Read the ground truth of the folder `path`: its `truth.csv`, or its annotation files.

    Raises `Rejected` if the folder has none of them.
    """
    if (path / TRUTH).is_file():
        return read_truth(path / TRUTH)
    if not list_files(path):
        message = f"The folder has neither {TRUTH} nor annotation files (*.pkl); expected its ground truth."
        raise reject("unreadable", message, path.name)
    return read_truth(path)


def _manifest(path: Path) -> Manifest:
    try:
        return read_manifest(path / MANIFEST)
    except Rejected as fault:
        named = [
            problem
            if problem.where.startswith(MANIFEST)
            else replace(problem, where=f"{MANIFEST}, {problem.where}" if problem.where else MANIFEST)
            for problem in fault.problems
        ]
        raise Rejected(named, n_problems=fault.n_problems) from None


def read_toolkit_folder(
    path: Path, *, manifest: Manifest | None = None
) -> tuple[Manifest, NDArray[np.float64]] | None:
    """Read sequences and boxes (n, 6, 4) in parts of the image; None for a folder without *.pkl.

    `manifest` gives order and anno_ids, else `tsttc manifest` does. Raises `Rejected` for faulty files or
    other sequences.
    """
    if not list_files(path):
        return None
    annotated = read_annotations(path, with_ttc=False, with_boxes=True)
    own = Manifest.from_table(annotated.table)
    boxes = np.array(annotated.boxes, dtype=np.float64).reshape(own.n_sequences, -1, 4)
    if manifest is None or manifest.digest == own.digest:
        return own, boxes
    require_the_same(own.natural_keys, manifest.natural_keys, path.name)
    rows = [own.row_of_natural_key[key] for key in manifest.natural_keys]
    return manifest, boxes[rows]
