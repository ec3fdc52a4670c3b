"""Frames whose reference is the whole target frame, warped by a known scale ratio."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from tsttc_baselines.boxes import box_around, expand
from tsttc_baselines.clips import TARGET, Clip, Image

Floats = NDArray[np.float64]


def texture(seed: int, *, width: int = 320, height: int = 240) -> Image:
    """Grey blobs of several sizes, equally rich everywhere."""
    rng = np.random.default_rng(seed)
    total = np.zeros((height, width), dtype=np.float32)
    for sigma in (1.5, 3.0, 6.0, 12.0):
        noise = cv2.GaussianBlur(rng.normal(size=total.shape).astype(np.float32), (0, 0), sigma)
        total += noise / noise.std()
    return np.asarray(np.clip(128 + 28 * total, 0, 255), dtype=np.uint8)


def warped(image: Image, *, scale_ratio: float, centre: Floats, shift: tuple[float, float] = (0, 0)) -> Image:
    """The frame whose object is `scale_ratio` times as large about `centre`, and moved by `shift` px."""
    middle = centre - 0.5  # of the pixel grid, whose first centre is at 0
    offset = middle + np.asarray(shift) - scale_ratio * middle
    matrix = np.array([[scale_ratio, 0, offset[0]], [0, scale_ratio, offset[1]]])
    if scale_ratio < 1:  # take means before leaving pixels out
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), 0.5 * np.sqrt(1 / scale_ratio**2 - 1) + 1e-3))
    return np.asarray(
        cv2.warpAffine(
            image, matrix, image.shape[1::-1], flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT
        ),
        dtype=np.uint8,
    )


def planted(seed: int, *, scale_ratio: float, size: tuple[float, float] = (60, 48)) -> Clip:
    """A clip whose first frame is its last one, warped by exactly this α, with the boxes that go with it."""
    target = texture(seed)
    centre = np.array([160.3, 119.6])
    box = box_around(centre, size)
    frames = [warped(target, scale_ratio=scale_ratio, centre=centre)] * TARGET + [target]
    return Clip.from_frames(frames, boxes=np.array([expand(box, scale_ratio)] * TARGET + [box]))


def rescaled(clip: Clip, factor: float) -> Clip:
    """The same frames, larger or smaller."""

    def load(frame: int, colour: bool) -> Image:
        image = clip.load(frame, colour)
        way = cv2.INTER_AREA if factor < 1 else cv2.INTER_LINEAR
        return np.asarray(cv2.resize(image, None, fx=factor, fy=factor, interpolation=way), dtype=np.uint8)

    return Clip(anno_id=clip.anno_id, boxes=clip.boxes * factor, load=load)
