"""The surroundings of a vehicle: the scenery behind it, and the road."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import cv2
import numpy as np

from tsttc_baselines.clips import Image
from tsttc_baselines.rendering.textures import SUBPIXEL_BITS, Colour, as_image, noise

N_SCENERIES: Final = 12
SCENERY_SIZE: Final = (400, 1100)
"""Height and width in texels; the last row stands on the ground."""
N_ROADS: Final = 4
ROAD_M_PER_TEXEL: Final = 0.15
ROAD_SIZE: Final = (640, 840)
"""Texels along and across the road."""


@lru_cache(maxsize=N_SCENERIES)
def scenery(number: int) -> Image:
    """Draw sky, hills, trees and buildings with an open middle; `SCENERY_SIZE`, four channels."""
    rng = np.random.default_rng([11, number])
    height, width = SCENERY_SIZE
    image = _sky(rng, height=height, width=width)
    x = np.arange(width)
    low = height - 24 - 14 * (1 + np.cumsum(rng.standard_normal(width)) / 30 % 2)
    hills = np.stack([x, cv2.GaussianBlur(low[None], (0, 0), 12)[0]], axis=1)
    haze: Colour = (178, 172, 160)
    cv2.fillPoly(image, [np.vstack([hills, [(width, height), (0, height)]]).astype(np.int32)], haze)
    _draw_buildings(image, rng)
    # Dead leaves: discs of falling size that hide one another, higher where the road is farther.
    for size in np.sort(rng.pareto(1.4, 900) * 3 + 3)[::-1]:
        centre = float(rng.uniform(0, width))
        away = abs(centre / width - 0.5) * 2
        reach = 16 + 170 * max(0.0, away - 0.06) ** 1.2
        y = height - float(rng.uniform(0, 1)) ** 1.5 * reach
        radius = min(float(size), 5 + 30 * away)
        green = rng.integers((22, 50, 34), (60, 120, 84))
        cv2.ellipse(
            image,
            (round(16 * centre), round(16 * y)),
            (round(16 * radius), round(16 * radius * float(rng.uniform(0.6, 1)))),
            float(rng.uniform(0, 180)),
            0,
            360,
            tuple(green.tolist()),
            -1,
            cv2.LINE_AA,
            SUBPIXEL_BITS,
        )
    for _ in range(int(rng.integers(2, 7))):
        x_pole = int(rng.integers(width))
        cv2.line(image, (x_pole, height), (x_pole, height - int(rng.integers(80, 220))), (84, 84, 86), 2)
    image = as_image(cv2.GaussianBlur(image, (0, 0), 0.6))
    light = cv2.resize(1 + 0.05 * noise(rng, height=height, width=1000), (width, height))
    shaded = cv2.multiply(image, cv2.merge([light] * 3), dtype=cv2.CV_8U)
    return as_image(cv2.cvtColor(shaded, cv2.COLOR_BGR2BGRA))


def _sky(rng: np.random.Generator, *, height: int, width: int) -> Image:
    top, bottom = rng.uniform((190, 160, 120), (235, 215, 200)), np.array((232, 228, 222))
    rows = np.linspace(0, 1, height)[:, None, None]
    clouds = cv2.resize(noise(rng, height=height, width=500), (width, height))[:, :, None]
    sky = rows * bottom + (1 - rows) * top + 7 * clouds
    return as_image(np.clip(sky, 0, 255))


def _draw_buildings(image: Image, rng: np.random.Generator) -> None:
    height, width = image.shape[:2]
    for _ in range(int(rng.integers(0, 9))):
        x = int(rng.integers(width))
        if abs(x / width - 0.5) < 0.08:
            continue
        tall, wide = int(rng.integers(40, 170)), int(rng.integers(40, 130))
        wall = int(rng.integers(120, 205))
        cv2.rectangle(image, (x, height - tall), (x + wide, height), (wall, wall, wall + 8), -1)
        for row in range(height - tall + 8, height - 10, 14):
            for column in range(x + 6, x + wide - 8, 12):
                cv2.rectangle(image, (column, row), (column + 6, row + 8), (wall - 60,) * 3, -1)


@lru_cache(maxsize=N_ROADS)
def road(number: int) -> Image:
    """Draw the ground from above, `ROAD_SIZE`, four channels: asphalt, shoulders, grass."""
    rng = np.random.default_rng([13, number])
    height, width = ROAD_SIZE
    across_m = np.abs((np.arange(width) + 0.5 - width / 2) * ROAD_M_PER_TEXEL)
    asphalt = float(rng.uniform(88, 128))
    image = np.empty((height, width, 3), dtype=np.float32)
    image[:] = asphalt
    image[:, across_m > 7.2] = (asphalt * 0.82, asphalt * 0.84, asphalt * 0.86)
    image[:, across_m > 9.0] = (58, 98, 84)
    streaks = cv2.GaussianBlur(
        np.asarray(rng.standard_normal((height, width)), dtype=np.float32), (0, 0), sigmaX=0.6, sigmaY=8
    )
    image += (streaks / streaks.std() * np.where(across_m > 9.0, 10, 4))[:, :, None]
    tracks = np.exp(-(((across_m[None, :] - np.array([[0.8], [2.95], [4.5]])) / 0.35) ** 2)).sum(axis=0)
    image -= (7 * tracks)[None, :, None]
    return as_image(cv2.cvtColor(np.clip(image, 0, 255).astype(np.uint8), cv2.COLOR_BGR2BGRA))
