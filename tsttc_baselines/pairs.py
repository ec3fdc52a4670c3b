"""Pairs to learn from: of a folder with ground truth, or of the renderer; changed a little each time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from evaluator import GroundTruth, fps_of_gap, ttc_to_scale_ratio
from evaluator.counting import counted
from evaluator.problems import reject
from tsttc_baselines.clips import TARGET, Clip, Image
from tsttc_baselines.folders import SequenceFolder, read_folder, read_folder_truth
from tsttc_baselines.images import ImageCache
from tsttc_baselines.patches import boxes_of_pair, require_centre_inside
from tsttc_baselines.rendering.clips import Rendered, render
from tsttc_baselines.scales import SCALE_RANGES
from tsttc_baselines.simulation import Split

Floats = NDArray[np.float64]

FRAME_GAP: Final = 5
_HSV: Final = (5.0, 30.0, 30.0)
"""Greatest change of hue, saturation and brightness, in OpenCV's units: YOLOX's."""

_BOX_JITTER: Final = 0.01
"""Standard deviation of an edge, as a share of the side: detectors err, and the box must not give α away."""

_RESIZING: Final = 0.06
"""The reference frame is made larger or smaller by up to e to this power, and α with it."""


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """Two colour frames, boxes (4,) in pixels, and α."""

    reference: Image
    target: Image
    boxes: tuple[Floats, Floats]
    scale_ratio: float


class Source(Protocol):
    """Sequences with true times to contact, to train on: an object with these properties and this method."""

    @property
    def truth(self) -> GroundTruth:
        """The ground truth, in row order."""
        ...

    @property
    def scale_ratios(self) -> Floats:
        """The α of each row's pair, (n,)."""
        ...

    def clip(self, row: int) -> Clip:
        """Return the sequence of a row."""
        ...


@dataclass(frozen=True, eq=False)
class RenderedSequences:
    """The sequences of a simulated split; frames are rendered once and kept as JPEG."""

    split: Split
    seed: int
    _rendered: dict[int, Rendered] = field(default_factory=dict)

    @property
    def truth(self) -> GroundTruth:
        return self.split.truth

    @property
    def scale_ratios(self) -> Floats:
        # From distances: a time to contact is less exact while the vehicle brakes.
        return self.split.gap_m[:, TARGET] / self.split.gap_m[:, TARGET - FRAME_GAP]

    def clip(self, row: int) -> Clip:
        if row not in self._rendered:
            self._rendered[row] = render(self.split, anno_id=row, seed=self.seed)
        return self._rendered[row].clip


@dataclass(frozen=True, eq=False)
class FolderSequences:
    """The sequences of a folder, in its ground truth's order."""

    folder: SequenceFolder
    truth: GroundTruth
    rows: Sequence[int]
    """The folder's row of each sequence of the ground truth."""
    _cache: ImageCache = field(default_factory=ImageCache)

    @classmethod
    def read(cls, path: Path) -> FolderSequences:
        """Read a folder with its ground truth; raises `Rejected` for one without."""
        return cls.of(read_folder(path), read_folder_truth(path))

    @classmethod
    def of(cls, folder: SequenceFolder, truth: GroundTruth) -> FolderSequences:
        """Match `truth` by natural keys; raises `Rejected` if the folder lacks one."""
        row_of = {key: row for row, key in enumerate(folder.manifest.natural_keys)}
        missing = [key for key in truth.manifest.natural_keys if key not in row_of]
        if missing:
            message = (
                f"The ground truth has {counted(len(missing), 'sequence')} without boxes, "
                f"the first is {missing[0]}; expected boxes for every sequence."
            )
            raise reject("missing-keys", message)
        return cls(folder, truth, [row_of[key] for key in truth.manifest.natural_keys])

    @property
    def scale_ratios(self) -> Floats:
        return ttc_to_scale_ratio(self.truth.ttc_s, fps_hz=fps_of_gap(FRAME_GAP))

    def clip(self, row: int) -> Clip:
        return self.folder.clip(self.rows[row], cache=self._cache)


def usable_pair(source: Source, row: int, *, scale_ratio: float) -> Pair:
    """Return the pair of a row; raises `Unusable` for missing or too small frames or boxes."""
    clip = source.clip(row)
    boxes = boxes_of_pair(clip, frame_gap=FRAME_GAP)
    frames = clip.colour(TARGET - FRAME_GAP), clip.colour(TARGET)
    for image, box, name in zip(frames, boxes, ("reference", "target"), strict=True):
        require_centre_inside(image, box, name=name)
    return Pair(*frames, boxes, scale_ratio)


def can_say(scale_ratio: float) -> bool:
    least, greatest = SCALE_RANGES[FRAME_GAP]
    return least <= scale_ratio <= greatest


def augmented(pair: Pair, *, rng: np.random.Generator) -> Pair:
    """Vary colours and boxes; perhaps mirror, reverse or resize the pair."""
    pair = _jittered(_recoloured(pair, rng=rng), rng=rng)
    if rng.random() < 0.5:
        pair = _mirrored(pair)
    if rng.random() < 0.25 and can_say(1 / pair.scale_ratio):
        pair = Pair(pair.target, pair.reference, pair.boxes[::-1], 1 / pair.scale_ratio)
    ratio = float(np.exp(rng.uniform(-_RESIZING, _RESIZING)))
    if rng.random() < 0.3 and can_say(pair.scale_ratio * ratio):
        pair = _resized(pair, ratio)
    return pair


def _recoloured(pair: Pair, *, rng: np.random.Generator) -> Pair:
    """Change hue, saturation and brightness of both frames alike, as the paper's HSV augmentation."""
    change = np.round(rng.uniform(-1, 1, 3) * _HSV).astype(np.int16)

    def recoloured(image: Image) -> Image:
        hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV).astype(np.int16) + change
        hsv[..., 0] %= 180
        return np.asarray(
            cv2.cvtColor(np.clip(hsv, 0, 255).astype(np.uint8), cv2.COLOR_HSV2BGR), dtype=np.uint8
        )

    return Pair(recoloured(pair.reference), recoloured(pair.target), pair.boxes, pair.scale_ratio)


def _jittered(pair: Pair, *, rng: np.random.Generator) -> Pair:
    reference, target = (
        box + _BOX_JITTER * rng.normal(size=4) * np.tile(box[2:] - box[:2], 2) for box in pair.boxes
    )
    return Pair(pair.reference, pair.target, (reference, target), pair.scale_ratio)


def _mirrored(pair: Pair) -> Pair:
    width_px = pair.target.shape[1]
    reference, target = (
        np.array([width_px - box[2], box[1], width_px - box[0], box[3]]) for box in pair.boxes
    )
    return Pair(
        np.ascontiguousarray(pair.reference[:, ::-1]),
        np.ascontiguousarray(pair.target[:, ::-1]),
        (reference, target),
        pair.scale_ratio,
    )


def _resized(pair: Pair, ratio: float) -> Pair:
    height, width = pair.reference.shape[:2]
    size = max(1, round(width * ratio)), max(1, round(height * ratio))
    interpolation = cv2.INTER_AREA if ratio < 1 else cv2.INTER_LINEAR
    reference = np.asarray(cv2.resize(pair.reference, size, interpolation=interpolation), dtype=np.uint8)
    growth = np.array([size[0] / width, size[1] / height])
    scale_ratio = pair.scale_ratio * float(np.sqrt(growth.prod()))
    return Pair(reference, pair.target, (pair.boxes[0] * np.tile(growth, 2), pair.boxes[1]), scale_ratio)
