"""Scenes with a planted scale ratio: a textured plane before a textured background."""

from collections.abc import Callable
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from evaluator.metrics.registry import MID
from evaluator.metrics.scale import fps_of_gap, scale_ratio_to_ttc
from tsttc_baselines.boxes import box_around
from tsttc_baselines.clips import N_FRAMES, TARGET, Clip, Image

Floats = NDArray[np.float64]
Pixels = NDArray[np.float32]


@cache
def texture(seed: int, *, side: int = 900) -> Pixels:
    """Grey levels float32 (side, side) with detail at every size, 20 … 235."""
    rng = np.random.default_rng(seed)
    frequency = np.hypot(*np.meshgrid(*[np.fft.fftfreq(side)] * 2))
    spectrum = np.fft.fft2(rng.standard_normal((side, side))) / np.maximum(frequency, 1 / side) ** 1.2
    noise = np.real(np.fft.ifft2(spectrum))
    return np.clip(128 + 45 * noise / noise.std(), 20, 235).astype(np.float32)


def planted(
    scale_ratio: float,
    *,
    seed: int = 0,
    shift: tuple[float, float] = (3.0, -2.0),
    box_px: tuple[float, float] = (90.0, 70.0),
    image_px: tuple[int, int] = (320, 240),
) -> Clip:
    """A clip whose plane is `scale_ratio` times as large in frame 0 as in frame 5; boxes are exact.

    `shift` is how far its centre moves from frame 5 to frame 0. The background keeps its size.
    """
    middle, sides = np.array(image_px) / 2, np.array(box_px)
    growths = scale_ratio ** ((TARGET - np.arange(N_FRAMES)) / TARGET)
    centres = middle + np.outer((TARGET - np.arange(N_FRAMES)) / TARGET, shift)
    boxes = box_around(centres, growths[:, None] * sides)

    @cache
    def draw(frame: int, colour: bool) -> Image:
        # 3 texels to a pixel of the target frame: neither aliased nor blurred.
        front = _drawn(texture(seed), image_px, centre=centres[frame], px_per_texel=growths[frame] / 3)
        behind = _drawn(texture(seed + 1000), image_px, centre=middle, px_per_texel=0.4)
        mask = _box_mask(boxes[frame], front.shape)
        grey = np.round(mask * front + (1 - mask) * behind).astype(np.uint8)
        return np.repeat(grey[:, :, None], 3, axis=2) if colour else grey

    return Clip(anno_id=seed, boxes=boxes, load=draw)


def _drawn(image: Pixels, image_px: tuple[int, int], *, centre: Floats, px_per_texel: float) -> Floats:
    """The texture about `centre`, drawn three times too large and averaged down."""
    fine = 3
    width, height = image_px
    scale = px_per_texel * fine
    middle = (np.array(image.shape) - 1) / 2
    offset = centre * fine - 0.5 - scale * middle
    warp = np.array([[scale, 0, offset[0]], [0, scale, offset[1]]])
    drawn = cv2.warpAffine(
        image, warp, (width * fine, height * fine), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT
    )
    return np.asarray(cv2.resize(drawn, (width, height), interpolation=cv2.INTER_AREA), dtype=np.float64)


def _box_mask(box: Floats, shape: tuple[int, ...]) -> Floats:
    """How much of each pixel the box covers, 0…1."""
    columns, rows = (
        np.clip(np.minimum(np.arange(n) + 1, high) - np.maximum(np.arange(n), low), 0, 1)
        for n, low, high in ((shape[1], box[0], box[2]), (shape[0], box[1], box[3]))
    )
    return np.asarray(np.outer(rows, columns))


def changed(clip: Clip, change: Callable[[int, Image], Image]) -> Clip:
    """The clip with `change(frame, image)` for each of its grey frames."""
    return Clip(anno_id=clip.anno_id, boxes=clip.boxes, load=lambda frame, _: change(frame, clip.grey(frame)))


def swapped(clip: Clip) -> Clip:
    """The clip in the reverse order of time."""
    return Clip(anno_id=clip.anno_id, boxes=clip.boxes[::-1], load=lambda frame, _: clip.grey(TARGET - frame))


def mean_mid(scale_ratios: list[float], true_ttc_s: Floats, *, frame_gap: int = TARGET) -> float:
    """Mean MiD (×10⁻⁴) of these scale ratios, as the protocol truncates them."""
    ttc_s = scale_ratio_to_ttc(scale_ratios, fps_hz=fps_of_gap(frame_gap))
    return float(np.mean(MID.errors(np.clip(ttc_s, -20, 20), true_ttc_s)))
