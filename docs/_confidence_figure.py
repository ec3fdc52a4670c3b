"""A figure of what Deep Scale saw of a sequence, and how sure it was of each scale ratio."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from baselines.boxes import Floats
from baselines.clips import Clip
from baselines.deep_scale.crops import Crop
from baselines.deep_scale.estimator import N_TOP, DeepScale, network_scales
from baselines.drawing import THEMES, Figure, Line, Picture, Text, outline
from baselines.scales import best_of
from evaluator.metrics.scale import fps_of_gap, scale_ratio_to_ttc, ttc_to_scale_ratio

_MARGIN: Final = 24.0
_SIDE: Final = 200.0
_BAR: Final = 8.0


def confidence_figure(
    clip: Clip, *, estimator: DeepScale, frame_gap: int, true_ttc_s: float, theme: str = "light"
) -> Figure:
    """Both crops as the network gets them, and its confidences over the scale ratios; raises `Unusable`."""
    crops = estimator.crops(clip, frame_gap=frame_gap)
    confidences = estimator.confidences(crops)
    scale_ratio = estimator(clip, frame_gap=frame_gap).scale_ratio
    ttc_s = float(scale_ratio_to_ttc(scale_ratio, fps_hz=fps_of_gap(frame_gap)))
    headline = (
        f"Sequence {clip.anno_id}: α = {scale_ratio:.3f}, TTC {ttc_s:.1f} s; true TTC {true_ttc_s:.1f} s"
    )
    figure = Figure(920, 360, THEMES[theme], headline.replace("-", "−"))
    colours = figure.theme
    figure.shapes.append(Text(figure.title, _MARGIN, 36, colours.ink, size=18, is_bold=True))
    for number, (crop, name) in enumerate(((crops.reference, "Reference"), (crops.target, "Target"))):
        x = _MARGIN + number * (_SIDE + 16)
        _add_crop(figure, crop, x=x, y=64, name=name)
    true_ratio = float(ttc_to_scale_ratio(true_ttc_s, fps_hz=fps_of_gap(frame_gap)))
    _add_bars(figure, confidences, estimate=scale_ratio, truth=true_ratio)
    return figure


def _add_crop(figure: Figure, crop: Crop, *, x: float, y: float, name: str) -> None:
    """A crop in grey, as large as `_SIDE` has room for, with the target's box about its centre."""
    height, width = crop.pixels.shape[:2]
    scale = _SIDE / max(height, width)
    grey = np.clip(np.round(crop.pixels.mean(axis=2)), 0, 255).astype(np.uint8)
    box = [float(value) * scale + (x if axis % 2 == 0 else y) for axis, value in enumerate(crop.box)]
    figure.shapes += [
        Picture(grey, x, y, width * scale, height * scale),
        outline(box, colour=figure.theme.accent),
        Text(f"{name}, {width} × {height} pixels", x, y + _SIDE + 20, figure.theme.ink, is_bold=True),
        Text(
            "the target's size" if name == "Reference" else "its box",
            x,
            y + _SIDE + 37,
            figure.theme.quiet,
            12,
        ),
    ]


def _add_bars(figure: Figure, confidences: Floats, *, estimate: float, truth: float) -> None:
    left, right, top, bottom = 500.0, figure.width - 32.0, 84.0, 280.0
    scales, colours = network_scales(), figure.theme
    best = set(best_of(-confidences, n_top=N_TOP).tolist())

    low, high = float(scales[0]), float(scales[-1])

    def x(scale: float) -> float:
        return left + (scale - low) / (high - low) * (right - left)

    figure.shapes.append(Text("Confidence of each scale ratio", left - 30, top - 22, colours.quiet, size=12))
    for part in (0.0, 0.5, 1.0):
        y = bottom - part * (bottom - top)
        figure.shapes.append(Line([(left - 12, y), (right + 12, y)], colours.hair))
        figure.shapes.append(Text(f"{part:g}", left - 18, y + 4, colours.quiet, 12, "end"))
    for number, (scale, confidence) in enumerate(zip(scales.tolist(), confidences.tolist(), strict=True)):
        y = bottom - max(confidence * (bottom - top), 1.5)
        colour = colours.mark if number in best else colours.accent
        figure.shapes.append(Line([(x(scale), bottom), (x(scale), y)], colour, _BAR))
    for tick in np.arange(math.ceil(low * 10), math.floor(high * 10) + 1) / 10:
        figure.shapes.append(Text(f"{tick:.1f}", x(tick), bottom + 20, colours.ink, 12, "middle"))
    figure.shapes.append(Text("scale ratio α", (left + right) / 2, bottom + 40, colours.quiet, 12, "middle"))
    is_left = truth < 1.1
    for ratio, words, colour, height in (
        (estimate, f"α = {estimate:.3f}", colours.mark, top + 4),
        (truth, f"truth {truth:.3f}", colours.ink, top + 24),
    ):
        figure.shapes.append(Line([(x(ratio), height - 12), (x(ratio), bottom)], colour, 1.5))
        place = x(truth) + (44 if is_left else -44)
        figure.shapes.append(
            Text(words, place, height, colour, 13, "start" if is_left else "end", is_bold=True)
        )
