"""The figure of the task: six frames in which a vehicle changes its size, and the equations."""

import math
from collections.abc import Sequence
from typing import Final

from baselines.boxes import centre_of, size_of
from baselines.clips import N_FRAMES, TARGET, Image
from baselines.drawing import THEMES, Figure, Text, outline
from baselines.figures import GAP, MARGIN, FrameCrop, seconds
from evaluator.metrics.scale import FRAME_RATE_HZ, Floats, fps_of_gap

# From here on both equations have room side by side.
_WIDE: Final = 900
# Of the texts below the frames: still read where the figure is shrunk to a tablet.
_LABEL: Final = 15.0


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
    width = 2 * MARGIN + n_columns * side + (n_columns - 1) * GAP
    foot = 46.0 if width >= _WIDE else 114.0
    height = MARGIN + n_rows * (side + label) + foot
    title = (
        f"Six frames at 10 Hz. The vehicle's box is {_ratio(ratio)} times as large in the first as in the "
        f"last: the scale ratio. It means {seconds(ttc_s)} to contact."
    )
    figure = Figure(round(width), round(height), THEMES[theme], title)
    colours = figure.theme
    reach_px = 1.3 * float(size_of(boxes).max())
    for frame in range(N_FRAMES):
        x = MARGIN + (frame % n_columns) * (side + GAP)
        y = MARGIN + (frame // n_columns) * (side + label)
        crop = FrameCrop(
            frames[frame], centre=centre_of(boxes[frame]), reach_px=reach_px, x=x, y=y, side=side
        )
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
    _add_equations(figure, ratio, ttc_s, y=MARGIN + n_rows * (side + label) + 26)
    return figure


def _add_equations(figure: Figure, ratio: float, ttc_s: float, *, y: float) -> None:
    """The scale ratio and the time to contact: side by side, or below each other on two lines each."""
    colours = figure.theme
    sizes, time = "size in the reference ÷ size in the target", "time to contact τ = 1 / (2 Hz · (1/α − 1))"
    if figure.width < _WIDE:
        # No line begins with "=": each can be read without the one above.
        scale = (sizes, f"is the scale ratio α = {_ratio(ratio)}")
        lines = [(text, colours.mark) for text in scale]
        lines += [(text, colours.ink) for text in (time, f"so τ = {seconds(ttc_s)}")]
        for i, (text, colour) in enumerate(lines):
            figure.shapes.append(Text(text, MARGIN, y + 24 * i, colour, 15.5, is_bold=i < len(scale)))
        return
    right = figure.width - MARGIN
    figure.shapes += [
        Text(f"{sizes} = α = {_ratio(ratio)}", MARGIN, y, colours.mark, 18, is_bold=True),
        Text(f"{time} = {seconds(ttc_s)}", right, y, colours.ink, 18, anchor="end"),
    ]


def _ratio(scale: float) -> str:
    """A scale ratio over the whole gap, with so many digits that the printed time to contact follows from it.

    >>> _ratio(0.8), _ratio(0.811425)
    ('0.800', '0.8114')
    """

    def printed_seconds(ratio: float) -> str:
        growth = float(fps_of_gap(TARGET)) * (1 / ratio - 1)
        return seconds(1 / growth if growth else math.inf)

    printed = (f"{scale:.{digits}f}" for digits in range(3, 17))
    return next(
        (text for text in printed if printed_seconds(float(text)) == printed_seconds(scale)), f"{scale:.3f}"
    )
