"""Crops of both frames around their boxes as a Dataset of torch, to train one's own network.

    crops = BoxCrops("train/", augment=True)
    for batch in DataLoader(crops, batch_size=32, shuffle=True, num_workers=2):
        ratio = batch["box_ratio"] * network(batch["crops"]).exp()

Needs torch and OpenCV.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

try:
    import cv2
    import torch
    from torch.utils.data import Dataset
except ModuleNotFoundError as missing:
    packages = "torch opencv-python-headless"
    message = f"tsttc_baselines.torch needs {missing.name}; install it with: pip install {packages}"
    raise ModuleNotFoundError(message, name=missing.name) from None

from tsttc_baselines.boxes import Floats, centre_of, size_of
from tsttc_baselines.clips import TARGET, Clip, Image
from tsttc_baselines.detection import scale_ratio_of_two
from tsttc_baselines.estimates import Unusable
from tsttc_baselines.pairs import FRAME_GAP, FolderSequences, Source, augmented, usable_pair
from tsttc_baselines.patches import boxes_of_pair, cut, require_centre_inside

CONTEXT: Final = 1.2
"""The side of a crop, as a multiple of the root of its box's area."""


class BoxCrops(Dataset):  # type: ignore[misc]  # of an extra, which mypy skips
    """A `Dataset` of torch: pairs of crops, with their true scale ratio, to train a network.

    The arguments:

    - `source`: the path of a folder with ground truth, or a `tsttc_baselines.pairs.Source`.
    - `rows`: the rows of the ground truth to use; all by default.
    - `size_px`: the width and height of a crop in pixels.
    - `context`: the side of a crop, as a multiple of the square root of its box's area; 1.2 by default.
    - `augment`: if true, items are changed at random each time: colours and boxes; some pairs are also
      mirrored, swapped or resized, and their scale ratio is changed to fit.

    An item is a dict of tensors:

    - `crops`: shape (2, 3, size_px, size_px), the reference before the target, in red, green and
      blue between 0 and 1. Each crop is a square about its own box.
    - `box_ratio`: the side of the reference's square divided by that of the target's.
    - `scale_ratio`: the true α, at a gap of five frames.
    - `row`: the row of the ground truth.
    - `usable`: false if a box or an image of the sequence cannot be used. Then the crops are black, and
      `box_ratio` is computed from the boxes, or 1 without usable boxes.
    """

    def __init__(
        self,
        source: Source | str | os.PathLike[str],
        *,
        rows: Sequence[int] | None = None,
        size_px: int = 64,
        context: float = CONTEXT,
        augment: bool = False,
    ) -> None:
        """Raises `Rejected` for a folder at fault, or without ground truth."""
        self.source: Source = (
            FolderSequences.read(Path(source)) if isinstance(source, str | os.PathLike) else source
        )
        self.truth = self.source.truth
        self.rows = list(range(self.truth.n_sequences)) if rows is None else list(rows)
        self.size_px = size_px
        self.context = context
        self.augment = augment
        self._scale_ratios = self.source.scale_ratios

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, index: int) -> dict[str, Any]:
        row = self.rows[index]
        scale_ratio = float(self._scale_ratios[row])
        try:
            pair = usable_pair(self.source, row, scale_ratio=scale_ratio)
        except Unusable:
            return self._unusable(row, scale_ratio)
        if self.augment:
            seed = int(torch.randint(2**62, ()).item())  # torch gives each worker and epoch its own
            pair = augmented(pair, rng=np.random.default_rng(seed))
        crops, box_ratio = crops_of(
            (pair.reference, pair.target), pair.boxes, size_px=self.size_px, context=self.context
        )
        return _item(row, crops, box_ratio=box_ratio, scale_ratio=pair.scale_ratio, usable=True)

    def _unusable(self, row: int, scale_ratio: float) -> dict[str, Any]:
        crops = np.zeros((2, 3, self.size_px, self.size_px), dtype=np.float32)
        try:
            boxes = self.source.clip(row).boxes
            box_ratio = scale_ratio_of_two(boxes[TARGET - FRAME_GAP], boxes[TARGET], measure="sqrt-area")
        except Unusable:
            box_ratio = 1.0
        return _item(row, crops, box_ratio=box_ratio, scale_ratio=scale_ratio, usable=False)


def _item(
    row: int, crops: NDArray[np.float32], *, box_ratio: float, scale_ratio: float, usable: bool
) -> dict[str, Any]:
    numbers = {"box_ratio": box_ratio, "scale_ratio": scale_ratio}
    tensors = {name: torch.tensor(value, dtype=torch.float32) for name, value in numbers.items()}
    return {"row": row, "crops": torch.from_numpy(crops), "usable": torch.tensor(usable), **tensors}


def crops_of_clip(
    clip: Clip, *, frame_gap: int, size_px: int = 64, context: float = CONTEXT
) -> tuple[Any, float]:
    """Return the crops of a clip, as a tensor like those of `BoxCrops`, and their `box_ratio`.

    `frame_gap` is the number of frames from the reference to the target, 1 to 5; `size_px` and `context` are
    as in `BoxCrops`. Raises `Unusable` if a box is missing, too small, or has its centre outside of the
    image.
    """
    boxes = boxes_of_pair(clip, frame_gap=frame_gap)
    frames = clip.colour(TARGET - frame_gap), clip.colour(TARGET)
    for image, box, name in zip(frames, boxes, ("reference", "target"), strict=True):
        require_centre_inside(image, box, name=name)
    crops, box_ratio = crops_of(frames, boxes, size_px=size_px, context=context)
    return torch.from_numpy(crops), box_ratio


def crops_of(
    frames: tuple[Image, Image], boxes: tuple[Floats, Floats], *, size_px: int, context: float
) -> tuple[NDArray[np.float32], float]:
    """Return the crops of two frames, as an array like the tensors of `BoxCrops`, and their `box_ratio`.

    `frames` are the reference and the target in colour, `boxes` their boxes; `size_px` and `context` are as
    in `BoxCrops`.
    """
    sides = [context * float(np.sqrt(size_of(box).prod())) for box in boxes]
    crops = []
    for image, box, side in zip(frames, boxes, sides, strict=True):
        cell = side / size_px
        window = cut(image, centre=centre_of(box), size=(side, side), pixel_size=max(1.0, cell))
        x, y = centre_of(box)[:, np.newaxis] + (np.arange(size_px) - (size_px - 1) / 2) * cell
        [sampled] = window.sample(x[np.newaxis], y[np.newaxis])
        crops.append(cv2.cvtColor(sampled, cv2.COLOR_BGR2RGB).transpose(2, 0, 1))
    return np.asarray(np.stack(crops) / 255, dtype=np.float32), sides[0] / sides[1]
