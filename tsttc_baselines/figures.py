"""A figure: what Pixel MSE saw of a sequence and chose."""

from __future__ import annotations

import math
from typing import Final

import cv2
import numpy as np

from evaluator.metrics.scale import fps_of_gap, scale_ratio_to_ttc
from tsttc_baselines import patches
from tsttc_baselines.boxes import box_around, centre_of, size_of
from tsttc_baselines.clips import TARGET, Clip, Image
from tsttc_baselines.drawing import THEMES, Anchor, Dot, Figure, Line, Picture, Text, outline
from tsttc_baselines.pixel_mse import Floats, PixelMse
from tsttc_baselines.scales import Match, best_of

MARGIN: Final = 24.0
GAP: Final = 16.0
SMALL: Final = 15.0
"""The size of words, which stay readable where a phone shows the figure in its width."""


class FrameCrop:
    """A square part of a frame, drawn at (x, y) with `side` units."""

    def __init__(
        self, image: Image, *, centre: Floats, reach_px: float, x: float, y: float, side: float
    ) -> None:
        window = patches.cut(image, centre=centre, size=(reach_px, reach_px))
        grid = np.linspace(-0.5, 0.5, 2 * int(side), endpoint=False) + 0.25 / side
        (pixels,) = window.sample([centre[0] + grid * reach_px], [centre[1] + grid * reach_px])
        self.picture = Picture(np.clip(np.round(pixels), 0, 255).astype(np.uint8), x, y, side, side)
        self._low = centre - reach_px / 2
        self._scale = side / reach_px

    def to_figure(self, box: Floats) -> list[float]:
        corner = np.array([self.picture.x, self.picture.y] * 2)
        return [float(value) for value in (box - np.tile(self._low, 2)) * self._scale + corner]


def search_figure(
    clip: Clip,
    *,
    estimator: PixelMse,
    frame_gap: int,
    true_ttc_s: float | None = None,
    theme: str = "light",
) -> Figure:
    """Draw a pair's boxes, match, remaining difference, and errors over scale ratios; raises `Unusable`."""
    if estimator.variant != "paper":
        raise ValueError(f"The figure shows the paper's variant, not {estimator.variant}.")
    match = estimator.match(clip, frame_gap=frame_gap)
    ttc_s = float(scale_ratio_to_ttc(match.scale_ratio, fps_hz=fps_of_gap(frame_gap)))
    truth = "" if true_ttc_s is None else f"; true TTC {seconds(true_ttc_s)}"
    headline = f"Sequence {clip.anno_id}: α = {match.scale_ratio:.3f}, TTC {seconds(ttc_s)}{truth}"
    figure = Figure(560, 944, THEMES[theme], headline)
    colours = figure.theme
    figure.shapes.append(Text(headline, MARGIN, 36, colours.ink, size=18, is_bold=True))
    _add_crops(figure, clip, estimator, match, frame_gap)
    true_ratio = None
    if true_ttc_s is not None:
        true_ratio = 1 / (1 + 1 / (float(fps_of_gap(frame_gap)) * true_ttc_s))
    _add_curve(figure, match, estimator, frame_gap=frame_gap, true_ratio=true_ratio)
    return figure


def _add_crops(figure: Figure, clip: Clip, estimator: PixelMse, match: Match, frame_gap: int) -> None:
    side = (figure.width - 2 * MARGIN - GAP) / 2
    left, right, top, below = MARGIN, MARGIN + side + GAP, 62.0, 62.0 + side + 64
    reference = TARGET - frame_gap
    frames = (clip.grey(reference), clip.grey(TARGET))
    reference_box, target_box = estimator.boxes(clip, frames, frame_gap=frame_gap)
    best = int(np.argmin(match.errors))
    scale, size = float(match.scales[best]), size_of(target_box)
    cell_px = size / patches.cells_of(target_box, max_cells=estimator.cells)
    middle = centre_of(reference_box) + scale * cell_px * match.shifts[best]
    matched_box = box_around(middle, scale * size)
    # Both crops have one scale, so that the eye sees the change of size; the third follows the found box.
    reach_px = 1.35 * float(max(size_of(reference_box).max(), size.max()))
    ours, theirs, matched = (
        FrameCrop(image, centre=centre, reach_px=reach, x=x, y=y, side=side)
        for image, centre, reach, x, y in (
            (frames[0], centre_of(reference_box), reach_px, left, top),
            (frames[1], centre_of(target_box), reach_px, right, top),
            (frames[0], middle, scale * reach_px, left, below),
        )
    )
    remaining = cv2.absdiff(theirs.picture.pixels, matched.picture.pixels)
    strong = np.minimum(remaining.astype(np.uint16) * 3, 255).astype(np.uint8)
    # A photograph is as dark in both themes.
    bright, colours = THEMES["dark"], figure.theme
    figure.shapes += [
        ours.picture,
        outline(ours.to_figure(reference_box), colour=bright.accent),
        outline(ours.to_figure(matched_box), colour=bright.mark),
        theirs.picture,
        outline(theirs.to_figure(target_box), colour=bright.accent),
        matched.picture,
        outline(matched.to_figure(matched_box), colour=bright.mark),
        Picture(strong, right, below, side, side),
        outline(
            [v if i % 2 == 0 else v + below - top for i, v in enumerate(theirs.to_figure(target_box))],
            colour=bright.accent,
            width=1,
        ),
    ]
    captions = (
        (left, top, f"Reference, frame {reference}", f"its box; found: {scale:.3f} × target"),
        (right, top, f"Target, frame {TARGET}", "its box, whose size is compared"),
        (left, below, "Reference, enlarged", f"by 1/{scale:.3f}, about the found box"),
        (right, below, "Difference, × 3", f"RMS {math.sqrt(float(match.errors[best])):.1f} grey levels"),
    )
    for x, y, first, second in captions:
        figure.shapes.append(Text(first, x, y + side + 21, colours.ink, SMALL + 1, is_bold=True))
        figure.shapes.append(Text(second, x, y + side + 40, colours.quiet, SMALL))


def _add_curve(
    figure: Figure, match: Match, estimator: PixelMse, *, frame_gap: int, true_ratio: float | None
) -> None:
    left, right, top, bottom = 60.0, figure.width - 36.0, 716.0, 860.0
    errors = np.sqrt(match.errors)
    low, high = float(match.scales[0]), float(match.scales[-1])
    roof = _round_up(float(errors.max()))
    colours = figure.theme

    def x(scale: float) -> float:
        return left + (scale - low) / (high - low) * (right - left)

    def y(error: float) -> float:
        return bottom - error / roof * (bottom - top)

    figure.shapes.append(
        Text(
            "Root mean squared difference at the best shift, in grey levels",
            MARGIN,
            top - 16,
            colours.quiet,
            SMALL,
        )
    )
    for part in (0.0, 0.5, 1.0):
        figure.shapes.append(Line([(left, y(part * roof)), (right, y(part * roof))], colours.hair))
        figure.shapes.append(
            Text(f"{part * roof:g}", left - 8, y(part * roof) + 5, colours.quiet, SMALL, "end")
        )
    for tick in np.arange(math.ceil(low * 10 - 1e-9), math.floor(high * 10 + 1e-9) + 1) / 10:
        ttc_s = float(scale_ratio_to_ttc(tick, fps_hz=fps_of_gap(frame_gap)))
        figure.shapes.append(Line([(x(tick), bottom), (x(tick), bottom + 5)], colours.quiet))
        figure.shapes.append(Text(f"{tick:.1f}", x(tick), bottom + 21, colours.ink, SMALL, "middle"))
        figure.shapes.append(Text(seconds(ttc_s), x(tick), bottom + 39, colours.quiet, SMALL, "middle"))
    figure.shapes.append(
        Text(
            "scale ratio α, and the time to contact that it means",
            (left + right) / 2,
            bottom + 64,
            colours.quiet,
            SMALL,
            "middle",
        )
    )
    figure.shapes.append(
        Line(
            [(x(float(s)), y(float(e))) for s, e in zip(match.scales, errors, strict=True)], colours.accent, 2
        )
    )
    marked = [(match.scale_ratio, top + 6, f"α = {match.scale_ratio:.3f}", colours.mark)]
    if true_ratio is not None and low <= true_ratio <= high:
        marked.append((true_ratio, top + 28, f"truth {true_ratio:.3f}", colours.ink))
    for ratio, height, words, colour in marked:
        figure.shapes.append(Line([(x(ratio), height - 12), (x(ratio), bottom)], colour, 1.5))
        is_left = ratio < 1.2
        text_x = x(ratio) + (6 if is_left else -6)
        anchor: Anchor = "start" if is_left else "end"
        figure.shapes.append(Text(words, text_x, height, colour, SMALL + 1, anchor, is_bold=True))
    for i in best_of(match.errors, n_top=estimator.top):
        figure.shapes.append(Dot(x(float(match.scales[i])), y(float(errors[i])), 4, colours.mark))


def seconds(ttc_s: float) -> str:
    """Format seconds; ∞ for an object that keeps its size.

    >>> seconds(3.42), seconds(-12.3), seconds(1121.0), seconds(math.inf)
    ('3.4 s', '−12 s', 'over 100 s', '∞ s')
    """
    if not math.isfinite(ttc_s):
        return "∞ s"
    if abs(ttc_s) > 100:
        return "over 100 s" if ttc_s > 0 else "under −100 s"
    digits = 1 if abs(ttc_s) < 10 else 0
    return f"{ttc_s:.{digits}f} s".replace("-", "−")


def _round_up(value: float) -> float:
    """Round up to 1, 2, 3, 4, 5, 6 or 8 × 10ⁿ.

    >>> _round_up(31.0), _round_up(0.7)
    (40.0, 0.8)
    """
    power = 10.0 ** math.floor(math.log10(max(value, 1e-9)))
    return next(step * power for step in (1, 2, 3, 4, 5, 6, 8, 10) if value <= step * power)
