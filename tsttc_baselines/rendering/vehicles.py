"""Vehicles from behind, drawn with polygons in metres: tail, cabin, shadow and lights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import cv2
import numpy as np

from tsttc_baselines.clips import Image
from tsttc_baselines.highway import VEHICLES, Vehicle
from tsttc_baselines.rendering.textures import SUBPIXEL_BITS, Colour, Texture, as_image, noise_field

_TOP: Final = 1.04
"""Where a texture ends above the vehicle, as a share of its height."""
_MARGIN: Final = 0.14
"""Room for the shadow beside the vehicle, as a share of its width."""
_PAINTS: Final[tuple[Colour, ...]] = (
    *((225, 226, 224), (196, 198, 198), (150, 150, 148), (98, 96, 94), (44, 42, 40), (28, 28, 30)),
    *((120, 72, 40), (46, 40, 140), (70, 60, 28), (84, 120, 132)),
)
_TARPAULINS: Final[tuple[Colour, ...]] = ((228, 228, 226), (150, 96, 40), (60, 60, 170), (90, 140, 70))


@dataclass(frozen=True, slots=True)
class Rear:
    """A vehicle from behind: the tail with its shadow, without and with brake lights, and the cabin."""

    tail: Texture
    tail_braking: Texture
    cabin: Texture
    paint: Colour


@lru_cache(maxsize=1)
def _irregularity() -> Image:
    # Around 128; opacity stays.
    grey = np.clip(128 + 24 * noise_field(), 0, 255)
    return as_image(cv2.merge([grey, grey, grey, np.full_like(grey, 128)]))


@lru_cache(maxsize=32)
def _shadow(kind: int, texels: int) -> Image:
    """Draw the shadow under a vehicle, fading to the sides."""
    vehicle = VEHICLES[kind]
    texels_per_m = texels / vehicle.width_m
    width = round(vehicle.width_m * (1 + 2 * _MARGIN) * texels_per_m)
    height = round((_TOP * vehicle.height_m + 0.12 * vehicle.width_m) * texels_per_m)
    y_m = _TOP * vehicle.height_m - (np.arange(height) + 0.5) / texels_per_m
    x_share = (np.arange(width) + 0.5) / width * (1 + 2 * _MARGIN) - 0.5 - _MARGIN
    across = np.clip((0.5 + _MARGIN - np.abs(x_share)) / (1.3 * _MARGIN), 0, 1)
    up = np.where(y_m < 0, np.clip(1 + y_m / 0.16, 0, 1), np.clip(1 - (y_m - 0.12) / 0.16, 0, 1))
    opacity = np.round(205 * up[:, None] * across[None, :])
    return as_image(cv2.merge([np.full_like(opacity, 22)] * 3 + [opacity]))


class _Drawing:
    """A texture drawn in metres: x right of the vehicle's middle, y up from the ground."""

    # Texels are opaque where something has been drawn. They begin as the shadow, or as nothing.

    def __init__(self, kind: int, *, texels: int, with_shadow: bool) -> None:
        vehicle = VEHICLES[kind]
        self.texels_per_m = texels / vehicle.width_m
        self.left_m = -vehicle.width_m * (0.5 + _MARGIN)
        self.top_m = _TOP * vehicle.height_m
        shadow = _shadow(kind, texels)
        self.pixels = shadow.copy() if with_shadow else np.zeros_like(shadow)

    def polygon(self, corners_m: Sequence[tuple[float, float]], colour: Colour) -> None:
        corners = (np.array(corners_m) - (self.left_m, self.top_m)) * (self.texels_per_m, -self.texels_per_m)
        fixed = np.round((corners - 0.5) * 2**SUBPIXEL_BITS).astype(np.int32)
        cv2.fillPoly(self.pixels, [fixed], (*colour, 255), cv2.LINE_AA, SUBPIXEL_BITS)

    def rectangle(self, *, x: float, y: float, width: float, height: float, colour: Colour) -> None:
        """Fill a rectangle with corners cut; (x, y) is the middle of its lower edge."""
        cut = 0.12 * min(width, height)
        half = width / 2
        self.polygon(
            [
                *(
                    (x - half + cut, y),
                    (x + half - cut, y),
                    (x + half, y + cut),
                    (x + half, y + height - cut),
                ),
                *((x + half - cut, y + height), (x - half + cut, y + height)),
                *((x - half, y + height - cut), (x - half, y + cut)),
            ],
            colour,
        )

    def shade(self, rng: np.random.Generator, *, dirt: float) -> None:
        """Add light from above, `dirt` (0 … 1) from below, and fine irregularity."""
        height, width = self.pixels.shape[:2]
        top, left = rng.integers(1024 - height + 1), rng.integers(1024 - width + 1)
        uneven = _irregularity()[top : top + height, left : left + width]
        strength = 0.35
        uneven_pixels = cv2.addWeighted(self.pixels, 1, uneven, strength, -128 * strength)
        # Two rows are enough for a gradient; opacity keeps its value.
        gradient = np.full((2, 1, 4), 128, dtype=np.uint8)
        gradient[:, :, :3] = np.array([146, 128 - 90 * dirt]).reshape(2, 1, 1)
        light = cv2.resize(gradient, (width, height), interpolation=cv2.INTER_LINEAR)
        self.pixels = as_image(cv2.addWeighted(uneven_pixels, 1, light, 1, -128))

    def texture(self) -> Texture:
        return Texture(
            pixels=self.pixels.copy(),
            left_m=self.left_m,
            top_m=self.top_m,
            texels_per_m=self.texels_per_m,
        )


def _darker(colour: Colour, factor: float) -> Colour:
    return (
        min(255, int(colour[0] * factor)),
        min(255, int(colour[1] * factor)),
        min(255, int(colour[2] * factor)),
    )


def rear(kind: int, *, texels: int, rng: np.random.Generator) -> Rear:
    """Draw a vehicle of this kind, `texels` (at most 512) across."""
    vehicle = VEHICLES[kind]
    paints = _TARPAULINS if vehicle.name == "truck" else _PAINTS
    paint = paints[int(rng.integers(len(paints)))]
    glass: Colour = (int(rng.integers(30, 60)),) * 3
    tail = _Drawing(kind, texels=texels, with_shadow=True)
    cabin = _Drawing(kind, texels=texels, with_shadow=False)
    if vehicle.name == "truck":
        _draw_truck(tail, vehicle, paint=paint, rng=rng)
    else:
        _draw_cabin(cabin, vehicle, paint=paint, glass=glass, rng=rng)
        cabin.shade(rng, dirt=0.0)
        _draw_tail(tail, vehicle, paint=paint, rng=rng)
    tail.shade(rng, dirt=float(rng.uniform(0.1, 0.35)))
    _draw_lights(tail, vehicle, lit=False)
    plain = tail.texture()
    _draw_lights(tail, vehicle, lit=True)
    return Rear(tail=plain, tail_braking=tail.texture(), cabin=cabin.texture(), paint=paint)


def _draw_tail(drawing: _Drawing, vehicle: Vehicle, *, paint: Colour, rng: np.random.Generator) -> None:
    width_m, waist_m = vehicle.width_m, _waist_m(vehicle)
    half = width_m / 2
    for side in (-1, 1):
        drawing.rectangle(
            x=side * 0.4 * width_m, y=0.0, width=0.13 * width_m, height=0.4, colour=(26, 25, 25)
        )
    body = [(-0.96 * half, 0.24), (0.96 * half, 0.24), (half, 0.42), (half, 0.8 * waist_m)]
    body += [(0.95 * half, waist_m), (-0.95 * half, waist_m), (-half, 0.8 * waist_m), (-half, 0.42)]
    drawing.polygon(body, paint)
    lid = [(-0.95 * half, 0.93 * waist_m), (0.95 * half, 0.93 * waist_m)]
    lid += [(0.93 * half, waist_m), (-0.93 * half, waist_m)]
    drawing.polygon(lid, _darker(paint, 1.08))
    bumper = _darker(paint, 0.8) if rng.random() < 0.6 else (52, 50, 50)
    drawing.rectangle(x=0, y=0.3, width=1.98 * half, height=0.24, colour=bumper)
    drawing.rectangle(x=0, y=0.22, width=1.8 * half, height=0.1, colour=(38, 37, 36))
    drawing.rectangle(x=0, y=0.56, width=1.9 * half, height=0.012, colour=_darker(paint, 0.55))
    for side in (-1, 1):
        drawing.rectangle(x=side * 0.8 * half, y=0.4, width=0.16, height=0.05, colour=(40, 40, 150))
    plate_y_m = float(rng.choice((0.36, 0.62 * waist_m)))
    plate = ((200, 120, 30), (225, 228, 228), (110, 170, 60))[int(rng.integers(3))]
    drawing.rectangle(x=0, y=plate_y_m - 0.02, width=0.56, height=0.18, colour=_darker(paint, 0.6))
    drawing.rectangle(x=0, y=plate_y_m, width=0.46, height=0.14, colour=plate)
    ink: Colour = (240, 240, 240) if plate[2] < 100 else (30, 30, 30)
    for number in range(7):
        x = -0.19 + 0.063 * number
        height = 0.08 * float(rng.uniform(0.7, 1))
        drawing.rectangle(x=x, y=plate_y_m + 0.03, width=0.035, height=height, colour=ink)
    drawing.rectangle(x=0, y=0.84 * waist_m, width=0.13, height=0.09, colour=(215, 215, 215))
    drawing.rectangle(x=0.3, y=0.84 * waist_m, width=0.22, height=0.03, colour=(200, 200, 200))


def _waist_m(vehicle: Vehicle) -> float:
    return {"sedan": 0.7, "hatchback": 0.64, "suv": 0.62, "van": 0.5}.get(
        vehicle.name, 1.0
    ) * vehicle.height_m


def _draw_cabin(
    drawing: _Drawing, vehicle: Vehicle, *, paint: Colour, glass: Colour, rng: np.random.Generator
) -> None:
    half, waist_m, top_m = vehicle.width_m / 2, _waist_m(vehicle), vehicle.height_m
    roof = {"sedan": 0.68, "hatchback": 0.74, "suv": 0.8, "van": 0.93}[vehicle.name]
    rise_m = top_m - waist_m
    outline = [(-0.94 * half, waist_m - 0.15), (0.94 * half, waist_m - 0.15), (0.94 * half, waist_m)]
    outline += [(roof * half, top_m - 0.1 * rise_m), (0.9 * roof * half, top_m)]
    outline += [(-0.9 * roof * half, top_m), (-roof * half, top_m - 0.1 * rise_m), (-0.94 * half, waist_m)]
    drawing.polygon(outline, _darker(paint, 0.92))
    window = [(-0.82 * half, waist_m + 0.08 * rise_m), (0.82 * half, waist_m + 0.08 * rise_m)]
    window += [(0.86 * roof * half, top_m - 0.2 * rise_m), (-0.86 * roof * half, top_m - 0.2 * rise_m)]
    drawing.polygon(window, glass)
    # The sky in the glass, and the heads of two passengers or seats behind it.
    shift = float(rng.uniform(-0.3, 0.3)) * half
    glare = [(shift - 0.3 * half, top_m - 0.2 * rise_m), (shift + 0.2 * half, top_m - 0.2 * rise_m)]
    glare += [(shift - 0.1 * half, waist_m + 0.08 * rise_m), (shift - 0.55 * half, waist_m + 0.08 * rise_m)]
    drawing.polygon(glare, (glass[0] + 40, glass[1] + 34, glass[2] + 28))
    for side in (-1, 1):
        drawing.rectangle(
            x=side * 0.38 * half,
            y=waist_m + 0.1 * rise_m,
            width=0.3 * half,
            height=0.4 * rise_m,
            colour=_darker(glass, 0.55),
        )


def _draw_truck(drawing: _Drawing, vehicle: Vehicle, *, paint: Colour, rng: np.random.Generator) -> None:
    width_m, half = vehicle.width_m, vehicle.width_m / 2
    for side in (-1, 1):
        drawing.rectangle(
            x=side * 0.36 * width_m, y=0.0, width=0.22 * width_m, height=0.9, colour=(24, 24, 24)
        )
    drawing.rectangle(x=0, y=0.45, width=0.96 * width_m, height=0.18, colour=(60, 60, 62))
    drawing.rectangle(x=0, y=0.8, width=0.98 * width_m, height=0.2, colour=(70, 70, 72))
    drawing.rectangle(x=0, y=0.95, width=width_m, height=vehicle.height_m - 0.95, colour=_darker(paint, 0.8))
    for side in (-1, 1):
        drawing.rectangle(
            x=side * 0.485 * half, y=1.05, width=0.94 * half, height=vehicle.height_m - 1.15, colour=paint
        )
        drawing.rectangle(x=side * 0.1, y=1.1, width=0.03, height=vehicle.height_m - 1.3, colour=(90, 90, 92))
        for y in (1.25, 1.9, 2.6):
            drawing.rectangle(x=side * 0.94 * half, y=y, width=0.1, height=0.05, colour=(80, 80, 82))
    ink = _darker(paint, 0.45)
    x = -0.75 * half
    while x < 0.7 * half:
        width = float(rng.uniform(0.05, 0.2))
        drawing.rectangle(
            x=x + width / 2, y=2.2, width=width, height=float(rng.uniform(0.18, 0.3)), colour=ink
        )
        x += width + 0.05
    drawing.rectangle(x=0.3 * half, y=0.47, width=0.46, height=0.13, colour=(60, 190, 220))


def _draw_lights(drawing: _Drawing, vehicle: Vehicle, *, lit: bool) -> None:
    half = vehicle.width_m / 2
    red: Colour = (70, 70, 255) if lit else (34, 30, 150)
    if vehicle.name == "truck":
        y, width, height = 0.62, 0.34, 0.14
    else:
        y, width, height = 0.6 * _waist_m(vehicle), 0.36 * half, 0.26 * _waist_m(vehicle)
    if vehicle.name == "van":
        width, height = 0.2 * half, 0.5 * _waist_m(vehicle)
    for side in (-1, 1):
        x = side * (half - width / 2 - 0.02)
        drawing.rectangle(x=x, y=y, width=width, height=height, colour=red)
        drawing.rectangle(x=x, y=y + 0.04, width=0.7 * width, height=0.25 * height, colour=(190, 200, 225))
    if lit and vehicle.name not in {"truck", "van"}:
        drawing.rectangle(x=0, y=0.95 * _waist_m(vehicle), width=0.3, height=0.03, colour=red)
