"""Textures: images of planes in the scene, and the 1/f noise that makes them uneven."""

# Four channels, the fourth for opacity: OpenCV warps four in less than half the time of three.

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from tsttc_baselines.clips import Image

Colour = tuple[int, int, int]
"""Blue, green, red, 0 … 255."""

SUBPIXEL_BITS: Final = 4
"""OpenCV draws at places that are sixteenths of a pixel."""


@dataclass(slots=True)
class Texture:
    """An upright plane, (height, width, 4), in metres right of and above the vehicle's foot."""

    pixels: Image
    left_m: float
    top_m: float
    texels_per_m: float
    _halves: list[Texture] = field(default_factory=list)

    def mipmap(self, *, texels_per_pixel: float) -> Texture:
        """Halve the texture until it has at most 1.6 texels per pixel of the canvas."""
        height, width = self.pixels.shape[0] // 2, self.pixels.shape[1] // 2
        if texels_per_pixel <= 1.6 or min(height, width) < 4:
            return self
        if not self._halves:
            even = self.pixels[: 2 * height, : 2 * width]
            self._halves.append(
                Texture(
                    pixels=as_image(cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA)),
                    left_m=self.left_m,
                    top_m=self.top_m,
                    texels_per_m=self.texels_per_m / 2,
                )
            )
        return self._halves[0].mipmap(texels_per_pixel=texels_per_pixel / 2)


def as_image(array: object) -> Image:
    return np.asarray(array, dtype=np.uint8)


@lru_cache(maxsize=1)
def noise_field() -> NDArray[np.float32]:
    """Make 1/f noise that tiles, (1024, 1024), mean 0, deviation 1."""
    rng = np.random.default_rng(7)
    spectrum = np.fft.rfft2(rng.standard_normal((1024, 1024)))
    frequency = np.hypot(np.fft.fftfreq(1024)[:, None], np.fft.rfftfreq(1024)[None, :])
    frequency[0, 0] = np.inf
    noise = np.fft.irfft2(spectrum / np.maximum(frequency, 1 / 256))
    return np.asarray(noise / noise.std(), dtype=np.float32)


def noise(rng: np.random.Generator, *, height: int, width: int) -> NDArray[np.float32]:
    """Cut a random window of the noise field, (height, width), at most 1024 a side."""
    top, left = rng.integers(1024 - height + 1), rng.integers(1024 - width + 1)
    return noise_field()[top : top + height, left : left + width]
