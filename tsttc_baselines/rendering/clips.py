"""From a sequence's motion to its six frames: scenery, road, vehicle, camera."""

# The planes of a small vehicle are warped onto a grid up to three times as fine and averaged, so that their
# scale is true to some hundredths of a pixel.

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Final

import cv2
import numpy as np

from evaluator.metrics.scale import FRAME_RATE_HZ
from tsttc_baselines.clips import N_FRAMES, TARGET, Clip, Image
from tsttc_baselines.highway import CAMERA_HEIGHT_M, IMAGE_HEIGHT_PX, IMAGE_WIDTH_PX, VEHICLES, Floats
from tsttc_baselines.rendering import camera, surroundings, vehicles
from tsttc_baselines.rendering.textures import Colour, Texture
from tsttc_baselines.simulation import Split

_CENTRE_PX: Final = (IMAGE_WIDTH_PX / 2, IMAGE_HEIGHT_PX / 2)
_FINENESS: Final = ((40.0, 3), (140.0, 2), (np.inf, 1))
"""Vehicles up to such a width in pixels are drawn on a grid so many times as fine as the image."""
_DASHED_LINES_M: Final = (-1.875, 1.875)
_SOLID_LINES_M: Final = (-5.625, 5.625)
_LINE_EDGES_M: Final = np.array([-0.08, 0.08, 0.08, -0.08])
_LINE_PAINT: Final = (205, 212, 214)
_DASH_M: Final = (6.0, 15.0)
_NEAREST_ROAD_M: Final = 1.2


@dataclass(frozen=True, slots=True)
class View:
    """The rendered part of the 1024 × 576 image, in whole pixels."""

    left: int
    top: int
    width: int
    height: int


@dataclass(frozen=True)
class Rendered:
    """One sequence, its frames rendered on access; boxes are in pixels of `view`."""

    anno_id: int
    view: View
    true_boxes: Floats
    """(6, 4): where the vehicle is."""
    boxes: Floats
    """(6, 4): what a detector says, inside the image."""
    _draw: Callable[[int], bytes]

    @cached_property
    def jpegs(self) -> tuple[bytes, ...]:
        return tuple(self._jpeg(frame) for frame in range(N_FRAMES))

    @cached_property
    def clip(self) -> Clip:
        def load(frame: int, colour: bool) -> Image:
            data = np.frombuffer(self._jpeg(frame), dtype=np.uint8)
            flag = cv2.IMREAD_COLOR if colour else cv2.IMREAD_GRAYSCALE
            return np.asarray(cv2.imdecode(data, flag), dtype=np.uint8)

        return Clip(anno_id=self.anno_id, boxes=self.boxes, load=load)

    @cached_property
    def _drawn(self) -> dict[int, bytes]:
        return {}

    def _jpeg(self, frame: int) -> bytes:
        if frame not in self._drawn:
            self._drawn[frame] = self._draw(frame)
        return self._drawn[frame]


@dataclass(frozen=True, slots=True)
class _Scene:
    """What a sequence's frames share, and its motion, (6,)."""

    vehicle: int
    focal_px: float
    gap_m: Floats
    lateral_m: Floats
    ego_mps: float
    rear: vehicles.Rear
    scenery: Image
    scenery_m: Floats
    scenery_shift_px: float
    road: Image
    road_shift_m: float
    road_start_m: float
    brakes_from: int
    """The first frame with brake lights; 6 for none."""
    occluder: tuple[float, float, float] | None
    """Left edge and width of a post, as shares of the vehicle's, and its brightness."""
    fineness: int


def render(split: Split, *, anno_id: int, seed: int, view: View | None = None) -> Rendered:
    """Render one sequence of a split; the same split and seed give the same bytes, in any order.

    The default `view` has half the vehicle's box on each side. `anno_id` is from 0 to `split.n_sequences` −
    1.
    """
    rng = np.random.default_rng([seed, anno_id])
    exposure = camera.Exposure.draw(rng)
    true_boxes, detected = _both_boxes(split, anno_id, exposure=exposure, rng=rng)
    shown = view or view_of(true_boxes)
    origin, size = np.array([shown.left, shown.top] * 2), [shown.width, shown.height] * 2

    @cache
    def scene() -> _Scene:
        width_px = float(true_boxes[:, 2].max() - true_boxes[:, 0].min())
        return _scene(split, anno_id, rng=rng, width_px=width_px)

    def draw(frame: int) -> bytes:
        seen = _draw(scene(), frame, view=shown, horizon_px=_CENTRE_PX[1] + exposure.pitch_px[frame])
        return camera.encode(camera.expose(seen, exposure=exposure, frame=frame))

    return Rendered(
        anno_id=anno_id,
        view=shown,
        true_boxes=true_boxes - origin,
        boxes=np.round(np.clip(detected - origin, 0, size), 2),
        _draw=draw,
    )


def boxes(split: Split, *, anno_id: int, seed: int) -> tuple[Floats, Floats]:
    """Return a sequence's true and detected boxes, (6, 4) in pixels of the 1024 × 576 image."""
    rng = np.random.default_rng([seed, anno_id])
    return _both_boxes(split, anno_id, exposure=camera.Exposure.draw(rng), rng=rng)


def view_of(true_boxes: Floats) -> View:
    """Return the view of true boxes (6, 4), with half the target's size and 10 px more on each side."""
    margin_px = 0.5 * (true_boxes[TARGET, 2:] - true_boxes[TARGET, :2]) + 10
    low = np.floor(np.maximum(true_boxes[:, :2].min(axis=0) - margin_px, 0)).astype(int)
    high = np.minimum(true_boxes[:, 2:].max(axis=0) + margin_px, (IMAGE_WIDTH_PX, IMAGE_HEIGHT_PX))
    width, height = (np.ceil(high).astype(int) - low).tolist()
    return View(left=int(low[0]), top=int(low[1]), width=width, height=height)


def _both_boxes(
    split: Split, anno_id: int, *, exposure: camera.Exposure, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    true_boxes = _true_boxes(split, anno_id, pitch_px=exposure.pitch_px)
    return true_boxes, camera.detect(true_boxes, rng=rng)


def _true_boxes(split: Split, anno_id: int, *, pitch_px: Floats) -> Floats:
    """Compute the vehicle's outline (6, 4) in the 1024 × 576 image."""
    # The top is the cabin's, which is farther.
    vehicle = VEHICLES[split.vehicle[anno_id]]
    focal_px, gap_m = split.focal_px[anno_id], split.gap_m[anno_id]
    middle_px = _CENTRE_PX[0] + focal_px * split.lateral_m[anno_id] / gap_m
    half_px = focal_px * vehicle.width_m / 2 / gap_m
    horizon_px = _CENTRE_PX[1] + pitch_px
    top_px = horizon_px + focal_px * (CAMERA_HEIGHT_M - vehicle.height_m) / (gap_m + vehicle.cabin_m)
    bottom_px = horizon_px + focal_px * CAMERA_HEIGHT_M / gap_m
    return np.stack([middle_px - half_px, top_px, middle_px + half_px, bottom_px], axis=1)


def _scene(split: Split, anno_id: int, *, rng: np.random.Generator, width_px: float) -> _Scene:
    fineness = next(fine for up_to_px, fine in _FINENESS if width_px <= up_to_px)
    texels = next(n for n in (64, 128, 256, 512) if n >= fineness * width_px or n == 512)
    gap_m = split.gap_m[anno_id]
    ego_mps = float(split.ego_mps[anno_id])
    to_target_s = np.arange(TARGET, -1, -1) / FRAME_RATE_HZ
    # What stands behind the vehicle is 1.5 to 5 times as far, and comes nearer at 12 m/s or so.
    behind_m = max(25.0, float(gap_m[TARGET] * rng.uniform(1.5, 5)))
    return _Scene(
        vehicle=split.vehicle[anno_id],
        focal_px=float(split.focal_px[anno_id]),
        gap_m=gap_m,
        lateral_m=split.lateral_m[anno_id],
        ego_mps=ego_mps,
        rear=vehicles.rear(split.vehicle[anno_id], texels=texels, rng=rng),
        scenery=surroundings.scenery(int(rng.integers(surroundings.N_SCENERIES))),
        scenery_m=np.maximum(behind_m + rng.uniform(0.4, 0.8) * ego_mps * to_target_s, gap_m + 3.0),
        scenery_shift_px=float(rng.uniform(-180, 180)),
        road=surroundings.road(int(rng.integers(surroundings.N_ROADS))),
        road_shift_m=float(rng.normal(scale=0.25)),
        road_start_m=float(rng.uniform(0, 60)),
        brakes_from=int(rng.choice((0, 3, 6), p=(0.3, 0.1, 0.6))),
        occluder=_draw_occluder(rng),
        fineness=fineness,
    )


def _draw_occluder(rng: np.random.Generator) -> tuple[float, float, float] | None:
    left, width, grey, luck = rng.uniform((-0.6, 0.05, 30, 0), (0.55, 0.15, 120, 1)).tolist()
    return (left, width, grey) if luck < 0.04 else None


def _draw(scene: _Scene, frame: int, *, view: View, horizon_px: float) -> Image:
    canvas = _Canvas(scene, frame, view=view, horizon_px=horizon_px)
    canvas.draw_scenery()
    canvas.draw_road()
    canvas.draw_side()
    vehicle, gap_m = VEHICLES[scene.vehicle], float(scene.gap_m[frame])
    if vehicle.name != "truck":
        canvas.draw_plane(scene.rear.cabin, depth_m=gap_m + vehicle.cabin_m)
    tail = scene.rear.tail_braking if frame >= scene.brakes_from else scene.rear.tail
    canvas.draw_plane(tail, depth_m=gap_m)
    canvas.draw_occluder()
    return canvas.image


class _Canvas:
    """Draws one frame from metres right of the optical axis, above the ground, and ahead."""

    def __init__(self, scene: _Scene, frame: int, *, view: View, horizon_px: float) -> None:
        self._scene = scene
        self._frame = frame
        self._x0 = _CENTRE_PX[0] - view.left
        self._y0 = horizon_px - view.top
        """The vanishing point, in pixels from the edge of the first one."""
        self._size = (view.width, view.height)
        self._pixels: Image = np.empty((view.height, view.width, 4), dtype=np.uint8)

    @property
    def image(self) -> Image:
        return np.asarray(cv2.cvtColor(self._pixels, cv2.COLOR_BGRA2BGR), dtype=np.uint8)

    def _project(self, x_m: Floats, y_m: Floats, depth_m: Floats) -> Floats:
        """Project to pixels (…, 2) from the edge of the first one."""
        scale = self._scene.focal_px / depth_m
        projected = np.empty((*scale.shape, 2))
        projected[..., 0] = self._x0 + scale * x_m
        projected[..., 1] = self._y0 + scale * (CAMERA_HEIGHT_M - y_m)
        return projected

    def _fill(self, polygons_px: Floats, colour: Colour) -> None:
        fixed = np.clip(np.round((polygons_px - 0.5) * 16), -(2**20), 2**20).astype(np.int32)
        cv2.fillPoly(self._pixels, list(fixed), (*colour, 255), cv2.LINE_AA, 4)

    def draw_scenery(self) -> None:
        scene = self._scene
        now_m = float(scene.scenery_m[self._frame])
        # A texel is a pixel of the target frame.
        texels = now_m / float(scene.scenery_m[TARGET])
        height, width = surroundings.SCENERY_SIZE
        foot_px = self._y0 + scene.focal_px * CAMERA_HEIGHT_M / now_m
        rows = min(self._size[1], int(np.ceil(foot_px)))
        if rows <= 0:
            return
        x_shift = width / 2 + scene.scenery_shift_px - self._x0 * texels
        cv2.warpAffine(
            scene.scenery,
            _matrix(texels, x_shift, height - foot_px * texels),
            (self._size[0], rows),
            dst=self._pixels[:rows],
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REFLECT,
        )

    def draw_road(self) -> None:
        scene = self._scene
        far_m = float(scene.scenery_m[self._frame])
        first = max(0, int(np.ceil(self._y0 + scene.focal_px * CAMERA_HEIGHT_M / far_m)))
        if first >= self._size[1]:
            return
        per_m = 1 / surroundings.ROAD_M_PER_TEXEL
        passed_m = scene.road_start_m + scene.ego_mps * self._frame / FRAME_RATE_HZ
        length, width = surroundings.ROAD_SIZE
        # From (x, y) to texels: depth = focal · height / (y − y0), across = (x − x0) · depth / focal.
        middle, along = width / 2 + scene.road_shift_m * per_m, (passed_m * per_m) % length
        side, reach = CAMERA_HEIGHT_M * per_m, scene.focal_px * CAMERA_HEIGHT_M * per_m
        x0, y0 = self._x0 - 0.5, self._y0 - 0.5 - first
        cv2.warpPerspective(
            scene.road,
            np.array(
                [[side, middle, -side * x0 - middle * y0], [0.0, along, reach - along * y0], [0.0, 1.0, -y0]]
            ),
            (self._size[0], self._size[1] - first),
            dst=self._pixels[first:],
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REFLECT,
        )
        self._draw_lines(passed_m=passed_m, far_m=far_m)

    def _draw_lines(self, *, passed_m: float, far_m: float) -> None:
        below_px = max(1.0, self._size[1] + 2 - self._y0)
        nearest_m = max(_NEAREST_ROAD_M, self._scene.focal_px * CAMERA_HEIGHT_M / below_px)
        dash_m, step_m = _DASH_M
        starts_m = np.arange(-(passed_m % step_m), far_m, step_m)
        ends_m = np.minimum(starts_m + dash_m, far_m)
        starts_m = np.maximum(starts_m, nearest_m)[ends_m > nearest_m]
        ends_m = ends_m[ends_m > nearest_m]
        n_dashes, n_solid = starts_m.size, len(_SOLID_LINES_M)
        low_m = np.concatenate([np.tile(starts_m, len(_DASHED_LINES_M)), np.full(n_solid, nearest_m)])
        high_m = np.concatenate([np.tile(ends_m, len(_DASHED_LINES_M)), np.full(n_solid, far_m)])
        lines_m = np.concatenate([np.repeat(_DASHED_LINES_M, n_dashes), _SOLID_LINES_M])
        depth_m = np.stack([low_m, low_m, high_m, high_m], axis=1)
        across_m = (lines_m - self._scene.road_shift_m)[:, None] + _LINE_EDGES_M
        self._fill(self._project(across_m, np.zeros(1), depth_m), _LINE_PAINT)

    def draw_side(self) -> None:
        scene, vehicle = self._scene, VEHICLES[self._scene.vehicle]
        gap_m, middle_m = float(scene.gap_m[self._frame]), float(scene.lateral_m[self._frame])
        edge_m = middle_m - np.sign(middle_m) * vehicle.width_m * 0.48
        if abs(middle_m) <= vehicle.width_m / 2:
            return
        back_m = gap_m + (8.0 if vehicle.name == "truck" else 4.2)
        blue, green, red = scene.rear.paint
        dark = (int(blue * 0.7), int(green * 0.7), int(red * 0.7))
        top = 0.62 if vehicle.name == "sedan" else 0.9

        def fill(low: float, high: float, start: float, end: float, colour: Colour) -> None:
            """A panel between shares of the height, and of the length counted from the tail."""
            depth_m = gap_m + (back_m - gap_m) * np.array([start, start, end, end])
            y_m = vehicle.height_m * np.array([low, high, high, low])
            self._fill(self._project(np.full(4, edge_m), y_m, depth_m)[None], colour)

        fill(0.0, 0.16, 0.02, 0.98, (34, 32, 32))
        fill(0.14, top, 0.0, 1.0, dark)
        if vehicle.name != "truck":
            fill(0.62, 0.97, 0.18, 0.62, dark)
            fill(0.66, 0.9, 0.22, 0.6, (58, 52, 48))
        for start in (0.12, 0.72):
            fill(0.0, 0.32, start, start + 0.16, (26, 25, 25))

    def draw_plane(self, texture: Texture, *, depth_m: float) -> None:
        scene, fine = self._scene, self._scene.fineness
        pixels_per_m = scene.focal_px / depth_m
        texture = texture.mipmap(texels_per_pixel=texture.texels_per_m / pixels_per_m / fine)
        lateral_m = float(scene.lateral_m[self._frame])
        left = self._x0 + pixels_per_m * (lateral_m + texture.left_m)
        top = self._y0 + pixels_per_m * (CAMERA_HEIGHT_M - texture.top_m)
        texels = texture.texels_per_m / pixels_per_m
        rows, columns = texture.pixels.shape[:2]
        x1, x2 = max(0, int(left) - 1), min(self._size[0], int(left + columns / texels) + 2)
        y1, y2 = max(0, int(top) - 1), min(self._size[1], int(top + rows / texels) + 2)
        if x2 <= x1 or y2 <= y1:
            return
        matrix = _matrix(texels / fine, (x1 - left) * texels, (y1 - top) * texels)
        size, flags = ((x2 - x1) * fine, (y2 - y1) * fine), cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        # The texels at the rim of a texture are transparent, so repeating them adds nothing.
        warped = cv2.warpAffine(texture.pixels, matrix, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
        over = cv2.resize(warped, (x2 - x1, y2 - y1), interpolation=cv2.INTER_AREA)
        weight = over[:, :, 3] * np.float32(1 / 255)
        under = np.ascontiguousarray(self._pixels[y1:y2, x1:x2])
        self._pixels[y1:y2, x1:x2] = cv2.blendLinear(over, under, weight, 1 - weight)

    def draw_occluder(self) -> None:
        """Draw a fixed post between camera and vehicle, half as far."""
        if self._scene.occluder is None:
            return
        scene, vehicle = self._scene, VEHICLES[self._scene.vehicle]
        left, width, grey = self._scene.occluder
        target_m = float(scene.gap_m[TARGET])
        to_target_s = (TARGET - self._frame) / FRAME_RATE_HZ
        depth_m = target_m / 2 + 0.3 * target_m * to_target_s
        # Placed over the vehicle in the target frame.
        x_m = (float(scene.lateral_m[TARGET]) + left * vehicle.width_m) / 2
        wide_m = width * vehicle.width_m / 2
        across_m = x_m + wide_m * np.array([0.0, 1.0, 1.0, 0.0])
        corners = self._project(across_m, np.array([0.0, 0.0, 4.0, 4.0]), np.full(4, depth_m))
        self._fill(corners[None], (int(grey),) * 3)


def _matrix(texels: float, x_shift: float, y_shift: float) -> Floats:
    """Return the matrix from image to texture at `texels` a pixel."""
    # Shifts count from edges, OpenCV from centres.
    middle = 0.5 * texels - 0.5
    return np.array([[texels, 0.0, x_shift + middle], [0.0, texels, y_shift + middle]])
