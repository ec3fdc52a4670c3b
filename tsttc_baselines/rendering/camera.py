"""Effects of a camera on a scene (defocus, exposure, shading, noise, JPEG), and of a detector on a box."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from tsttc_baselines.clips import N_FRAMES, Image
from tsttc_baselines.highway import Floats

JPEG_QUALITY: Final = 92
_SHARED: Final = 0.75
_NOISE_SIZE: Final = (640, 1088)


@dataclass(frozen=True, slots=True)
class Exposure:
    """The camera's state during one sequence, (6,) by frame."""

    gain: Floats
    offset: Floats
    """In grey levels."""
    pitch_px: Floats
    """How far the horizon has moved down."""
    defocus_px: float
    shading: tuple[float, float]
    """How brightness changes across and down the image, as a share."""
    read_noise: float
    shot_noise: float
    noise_from: Floats
    """(6, 2): where each frame's noise begins in the noise field, as shares of the room there."""

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Exposure:
        """Draw gain e^N(0, .05), offset N(0, 4) and pitch N(0, .3 px) by frame, the rest once."""
        return cls(
            gain=np.exp(rng.normal(scale=0.05, size=N_FRAMES)) * rng.uniform(0.75, 1.05),
            offset=rng.normal(scale=4.0, size=N_FRAMES),
            pitch_px=rng.normal(scale=0.3, size=N_FRAMES),
            defocus_px=float(rng.uniform(0.3, 0.8)),
            shading=(float(rng.normal(scale=0.06)), float(rng.normal(scale=0.06))),
            read_noise=float(rng.uniform(0.8, 2.2)),
            shot_noise=float(rng.uniform(0.06, 0.14)),
            noise_from=rng.random((N_FRAMES, 2)),
        )


@lru_cache(maxsize=1)
def _noise_field() -> NDArray[np.float32]:
    rng = np.random.default_rng(17)
    return rng.standard_normal((*_NOISE_SIZE, 3), dtype=np.float32)


def expose(scene: Image, *, exposure: Exposure, frame: int) -> Image:
    """Expose the scene (height, width, 3) as the sensor delivers it."""
    # Shot noise grows with the root of the brightness. A random window of one field costs a tenth of new
    # noise, and six frames do not show it.
    height, width = scene.shape[:2]
    blurred = cv2.GaussianBlur(scene, (0, 0), exposure.defocus_px)
    across, down = exposure.shading
    corners = np.array([[-across - down, across - down], [down - across, across + down]])
    gain = np.repeat((exposure.gain[frame] * (1 + corners)).astype(np.float32)[:, :, None], 3, axis=2)
    light = cv2.multiply(blurred, cv2.resize(gain, (width, height)), dtype=cv2.CV_32F)
    brightness = np.maximum(np.arange(256) * exposure.gain[frame] + exposure.offset[frame], 0)
    spread = np.sqrt(brightness * exposure.shot_noise + exposure.read_noise**2).astype(np.float32)
    room = np.array(_NOISE_SIZE) - (height, width) + 1
    top, left = (exposure.noise_from[frame] * room).astype(int).tolist()
    noise = cv2.multiply(cv2.LUT(blurred, spread), _noise_field()[top : top + height, left : left + width])
    # Adds the offset, rounds and clips.
    exposed = cv2.addWeighted(light, 1, noise, 1, exposure.offset[frame], dtype=cv2.CV_8U)
    return np.asarray(exposed, dtype=np.uint8)


def encode(image: Image) -> bytes:
    done, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not done:
        raise ArithmeticError(f"OpenCV cannot encode an image of shape {image.shape}.")
    return data.tobytes()


def detect(boxes: Floats, *, rng: np.random.Generator) -> Floats:
    """Detect boxes (6, 4): each edge is off by N(0, 1.5 % of the side + 0.6 px)."""
    # Errors of two frames correlate by 0.75, as on frames that look alike; the area rule then has the errors
    # of the published row.
    sides = boxes[:, 2:] - boxes[:, :2]
    scale = np.tile(0.015 * sides + 0.6, 2)
    shared, own = rng.normal(size=(1, 4)), rng.normal(size=boxes.shape)
    return np.asarray(boxes + scale * (np.sqrt(_SHARED) * shared + np.sqrt(1 - _SHARED) * own))
