"""The network's input: a crop of each frame about its box, with float boxes in its pixels."""

# The toolkit pads all crops to 300 × 300 pixels; these are only as large as the network looks, and faster.
# The frame's border repeats outside, so that no sequence is dropped and no centre moves.

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tsttc_baselines.boxes import (
    MAX_EXPANSION,
    Floats,
    box_around,
    centre_of,
    expand,
    shared_expansion,
    size_of,
)
from tsttc_baselines.clips import Image
from tsttc_baselines.deep_scale.network import MAX_SHIFT
from tsttc_baselines.patches import cut


@dataclass(frozen=True, slots=True, eq=False)
class Crop:
    """A crop: `pixels` float32 (h, w, 3), blue first, h and w even; `box` (4,) in its pixels."""

    pixels: NDArray[np.float32]
    box: Floats


@dataclass(frozen=True, slots=True, eq=False)
class CropPair:
    """Two crops; the reference's box has the target's size, to be multiplied by each scale ratio."""

    reference: Crop
    target: Crop


def cut_pair(
    reference: Image,
    target: Image,
    boxes: tuple[Floats, Floats],
    *,
    max_scale: float,
    max_box_px: float,
    margin_px: float,
    n_cells: int,
) -> CropPair:
    """Cut crops of two colour frames for scale ratios up to `max_scale`; `boxes` of both.

    Frames are shrunk by one ratio if the target's expanded box is over `max_box_px`. `margin_px` surrounds
    the `n_cells` compared cells: features near a crop's edge have seen zeros.
    """
    height, width = target.shape[:2]
    ratio = shared_expansion(*boxes, width_px=width, height_px=height, at_most=MAX_EXPANSION)
    size = size_of(expand(boxes[1], ratio))
    pixel_size = max(1.0, float(np.max(size)) / max_box_px)
    reach = max_scale * (n_cells + 2 * MAX_SHIFT) / n_cells
    margin = 2 * margin_px * pixel_size
    return CropPair(
        _crop(reference, box_around(centre_of(boxes[0]), size), size * reach + margin, pixel_size=pixel_size),
        _crop(target, box_around(centre_of(boxes[1]), size), size + margin, pixel_size=pixel_size),
    )


def _crop(image: Image, box: Floats, size: Floats, *, pixel_size: float) -> Crop:
    window = cut(image, centre=centre_of(box), size=size, pixel_size=pixel_size)
    height, width = (side - side % 2 for side in window.pixels.shape[:2])
    origin, pixel = np.tile(window.origin, 2), np.tile(window.pixel_size, 2)
    return Crop(window.pixels[:height, :width], (box - origin) / pixel)
