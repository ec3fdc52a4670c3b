"""Two figures: what Pixel MSE saw of a sequence and chose, and what the task is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np

from baselines import patches
from baselines.boxes import box_around, centre_of, size_of
from baselines.clips import N_FRAMES, TARGET, Clip, Image
from baselines.drawing import THEMES, Anchor, Dot, Figure, Line, Picture, Text, outline
from baselines.pixel_mse import Floats, PixelMse
from baselines.scales import Match, best_of
from evaluator.metrics.scale import FRAME_RATE_HZ, fps_of_gap, scale_ratio_to_ttc

_MARGIN: Final = 24.0
_GAP: Final = 16.0
# From here on both equations of the task figure have room side by side.
_WIDE: Final = 900
# Of its texts below the frames: still read where the figure is shrunk to a tablet.
_LABEL: Final = 15.0


class _Crop:
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

    def place(self, box: Floats) -> list[float]:
        """A box of the frame in units of the figure."""
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
    """Reference and target with their boxes, the reference as it matches the target, what is left of the
    difference, and the errors over all scale ratios with the chosen one.

    `estimator` is the paper's variant. Raises `Unusable` as it does.
    """
    if estimator.variant != "paper":
        raise ValueError(f"The figure shows the paper's variant, not {estimator.variant}.")
    match = estimator.match(clip, frame_gap=frame_gap)
    ttc_s = float(scale_ratio_to_ttc(match.scale_ratio, fps_hz=fps_of_gap(frame_gap)))
    truth = "" if true_ttc_s is None else f"; true TTC {_seconds(true_ttc_s)}"
    headline = f"Sequence {clip.anno_id}: α = {match.scale_ratio:.3f}, TTC {_seconds(ttc_s)}{truth}"
    figure = Figure(920, 560, THEMES[theme], headline)
    colours = figure.theme
    figure.shapes.append(Text(headline, _MARGIN, 36, colours.ink, size=18, is_bold=True))
    _add_crops(figure, clip, estimator, match, frame_gap)
    true_ratio = None
    if true_ttc_s is not None:
        true_ratio = 1 / (1 + 1 / (float(fps_of_gap(frame_gap)) * true_ttc_s))
    _add_curve(figure, match, estimator, frame_gap=frame_gap, true_ratio=true_ratio)
    return figure


def _add_crops(figure: Figure, clip: Clip, estimator: PixelMse, match: Match, frame_gap: int) -> None:
    side = (figure.width - 2 * _MARGIN - 3 * _GAP) / 4
    top, reference = 62.0, TARGET - frame_gap
    frames = (clip.grey(reference), clip.grey(TARGET))
    reference_box, target_box = estimator.boxes(clip, frames, frame_gap=frame_gap)
    best = int(np.argmin(match.errors))
    scale, size = float(match.scales[best]), size_of(target_box)
    cell_px = size / patches.cells_of(target_box, max_cells=estimator.cells)
    middle = centre_of(reference_box) + scale * cell_px * match.shifts[best]
    found_box = box_around(middle, scale * size)
    # Both crops have one scale, so that the eye sees the change of size; the third follows the found box.
    reach_px = 1.35 * float(max(size_of(reference_box).max(), size.max()))
    places = [_MARGIN + i * (side + _GAP) for i in range(4)]
    ours, theirs, matched = (
        _Crop(image, centre=centre, reach_px=reach, x=x, y=top, side=side)
        for image, centre, reach, x in (
            (frames[0], centre_of(reference_box), reach_px, places[0]),
            (frames[1], centre_of(target_box), reach_px, places[1]),
            (frames[0], middle, scale * reach_px, places[2]),
        )
    )
    left = cv2.absdiff(theirs.picture.pixels, matched.picture.pixels)
    strong = np.minimum(left.astype(np.uint16) * 3, 255).astype(np.uint8)
    colours = figure.theme
    figure.shapes += [
        ours.picture,
        outline(ours.place(reference_box), colour=colours.accent),
        outline(ours.place(found_box), colour=colours.mark),
        theirs.picture,
        outline(theirs.place(target_box), colour=colours.accent),
        matched.picture,
        outline(matched.place(found_box), colour=colours.mark),
        Picture(strong, places[3], top, side, side),
        outline(
            [places[3] + v - places[1] if i % 2 == 0 else v for i, v in enumerate(theirs.place(target_box))],
            colour=colours.mark,
            width=1,
        ),
    ]
    captions = (
        (f"Reference, frame {reference}", f"its box; found: {scale:.3f} × target"),
        (f"Target, frame {TARGET}", "its box, the size that is compared"),
        ("Reference, enlarged", f"by 1/{scale:.3f}, about the found box"),
        ("Difference, × 3", f"RMS {math.sqrt(float(match.errors[best])):.1f} grey levels"),
    )
    for x, (first, second) in zip(places, captions, strict=True):
        figure.shapes.append(Text(first, x, top + side + 20, colours.ink, is_bold=True))
        figure.shapes.append(Text(second, x, top + side + 37, colours.quiet, size=12))


def _add_curve(
    figure: Figure, match: Match, estimator: PixelMse, *, frame_gap: int, true_ratio: float | None
) -> None:
    """Root mean squared errors over scale ratios, with the best ones and their mean."""
    left, right, top, bottom = 70.0, figure.width - 44.0, 356.0, 488.0
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
            left,
            top - 14,
            colours.quiet,
            size=12,
        )
    )
    for part in (0.0, 0.5, 1.0):
        figure.shapes.append(Line([(left, y(part * roof)), (right, y(part * roof))], colours.hair))
        figure.shapes.append(Text(f"{part * roof:g}", left - 8, y(part * roof) + 4, colours.quiet, 12, "end"))
    for tick in np.arange(math.ceil(low * 10 - 1e-9), math.floor(high * 10 + 1e-9) + 1) / 10:
        ttc_s = float(scale_ratio_to_ttc(tick, fps_hz=fps_of_gap(frame_gap)))
        figure.shapes.append(Line([(x(tick), bottom), (x(tick), bottom + 5)], colours.quiet))
        figure.shapes.append(Text(f"{tick:.1f}", x(tick), bottom + 20, colours.ink, 12, "middle"))
        figure.shapes.append(Text(_seconds(ttc_s), x(tick), bottom + 36, colours.quiet, 12, "middle"))
    figure.shapes.append(
        Text(
            "scale ratio α, and the time to contact that it means",
            (left + right) / 2,
            bottom + 56,
            colours.quiet,
            12,
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
        marked.append((true_ratio, top + 26, f"truth {true_ratio:.3f}", colours.ink))
    for ratio, height, words, colour in marked:
        figure.shapes.append(Line([(x(ratio), height - 12), (x(ratio), bottom)], colour, 1.5))
        is_left = ratio < 1.2
        place = x(ratio) + (6 if is_left else -6)
        anchor: Anchor = "start" if is_left else "end"
        figure.shapes.append(Text(words, place, height, colour, 13, anchor, is_bold=True))
    for i in best_of(match.errors, n_top=estimator.top):
        figure.shapes.append(Dot(x(float(match.scales[i])), y(float(errors[i])), 4, colours.mark))


def task_figure(
    frames: Sequence[Image],
    *,
    boxes: Floats,
    ttc_s: float,
    theme: str = "light",
    n_columns: int = N_FRAMES,
) -> Figure:
    """Six frames in which a vehicle changes its size, and what is to be estimated from them.

    `boxes` is (6, 4) in pixels, `ttc_s` the time to contact at the last frame. `n_columns` of the frames
    stand side by side: 6 for a wide page, 2 or 3 for a narrow one.
    """
    ratio = 1 / (1 + 1 / (float(fps_of_gap(TARGET)) * ttc_s))
    n_rows = math.ceil(N_FRAMES / n_columns)
    side, label = 168.0, 40.0
    width = 2 * _MARGIN + n_columns * side + (n_columns - 1) * _GAP
    foot = 46.0 if width >= _WIDE else 114.0
    height = _MARGIN + n_rows * (side + label) + foot
    title = (
        f"Six frames at 10 Hz. The vehicle's box is {_ratio(ratio)} times as large in the first as in the "
        f"last: the scale ratio. It means {_seconds(ttc_s)} to contact."
    )
    figure = Figure(round(width), round(height), THEMES[theme], title)
    colours = figure.theme
    reach_px = 1.3 * float(size_of(boxes).max())
    for frame in range(N_FRAMES):
        x = _MARGIN + (frame % n_columns) * (side + _GAP)
        y = _MARGIN + (frame // n_columns) * (side + label)
        crop = _Crop(frames[frame], centre=centre_of(boxes[frame]), reach_px=reach_px, x=x, y=y, side=side)
        is_end = frame in {0, TARGET}
        shown = colours.mark if is_end else colours.accent
        figure.shapes += [crop.picture, outline(crop.place(boxes[frame]), colour=shown)]
        name = {0: "reference", TARGET: "target"}.get(frame, "")
        at_s = (frame - TARGET) / FRAME_RATE_HZ
        figure.shapes.append(
            Text(f"{at_s:.1f} s".replace("-", "−"), x, y + side + 20, colours.quiet, size=_LABEL)
        )
        figure.shapes.append(
            Text(name, x + side, y + side + 20, colours.ink, _LABEL, anchor="end", is_bold=True)
        )
    _add_equations(figure, ratio, ttc_s, y=_MARGIN + n_rows * (side + label) + 26)
    return figure


def _add_equations(figure: Figure, ratio: float, ttc_s: float, *, y: float) -> None:
    """The scale ratio and the time to contact: side by side, or below each other on two lines each."""
    colours = figure.theme
    scale = ("size in the reference ÷ size in the target", f"= α = {_ratio(ratio)}")
    time = ("time to contact τ = 1 / (2 Hz · (1/α − 1))", f"= {_seconds(ttc_s)}")
    if figure.width < _WIDE:
        lines = [
            (text, colour) for texts, colour in ((scale, colours.mark), (time, colours.ink)) for text in texts
        ]
        for i, (text, colour) in enumerate(lines):
            figure.shapes.append(Text(text, _MARGIN, y + 24 * i, colour, 15.5, is_bold=i < 2))
        return
    figure.shapes += [
        Text(" ".join(scale), _MARGIN, y, colours.mark, 18, is_bold=True),
        Text(" ".join(time), figure.width - _MARGIN, y, colours.ink, 18, anchor="end"),
    ]


def _ratio(scale: float) -> str:
    """A scale ratio over the whole gap, with so many digits that the printed time to contact follows from it.

    >>> _ratio(0.8), _ratio(0.811425)
    ('0.800', '0.8114')
    """

    def seconds(ratio: float) -> str:
        growth = float(fps_of_gap(TARGET)) * (1 / ratio - 1)
        return _seconds(1 / growth if growth else math.inf)

    printed = (f"{scale:.{digits}f}" for digits in range(3, 17))
    return next((text for text in printed if seconds(float(text)) == seconds(scale)), f"{scale:.3f}")


def _seconds(ttc_s: float) -> str:
    """Seconds with a true minus sign, and a decimal for small values; ∞ for an object that keeps its size.

    >>> _seconds(3.42), _seconds(-12.3), _seconds(1121.0), _seconds(math.inf)
    ('3.4 s', '−12 s', 'over 100 s', '∞ s')
    """
    if not math.isfinite(ttc_s):
        return "∞ s"
    if abs(ttc_s) > 100:
        return "over 100 s" if ttc_s > 0 else "under −100 s"
    digits = 1 if abs(ttc_s) < 10 else 0
    return f"{ttc_s:.{digits}f} s".replace("-", "−")


def _round_up(value: float) -> float:
    """The next of 1, 2, 3, 4, 5, 6, 8 × 10ⁿ.

    >>> _round_up(31.0), _round_up(0.7)
    (40.0, 0.8)
    """
    power = 10.0 ** math.floor(math.log10(max(value, 1e-9)))
    return next(step * power for step in (1, 2, 3, 4, 5, 6, 8, 10) if value <= step * power)
