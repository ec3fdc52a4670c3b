"""`python -m docs._figures`: draw the figures of docs/baselines.md and of the landing page from sequences of
examples/baseline, those of docs/annotation.md, the picture that links to the site show, and the icon.
"""

import struct
from pathlib import Path
from typing import Final

from baselines.clips import Clip
from baselines.deep_scale.estimator import DeepScale
from baselines.drawing import JPEG_QUALITY, PNG_SCALE, THEMES, Figure, Line, Picture, Text, encoded, outline
from baselines.figures import search_figure
from baselines.folders import read_folder
from baselines.images import ImageCache
from baselines.pixel_mse import PixelMse
from docs._annotation_figures import choice_figure, consensus_figure
from docs._confidence_figure import confidence_figure
from docs._task_figure import task_figure
from evaluator import read_truth

REPOSITORY = Path(__file__).resolve().parents[1]
FOLDER = REPOSITORY / "examples" / "baseline"
FIGURES = REPOSITORY / "docs" / "figures"
STATIC = REPOSITORY / "static"
# Of the landing page: small enough for a first visit, and still sharp.
WEB_JPEG_QUALITY: Final = 50
COLUMNS: Final = {"wide": 6, "narrow": 2}
ICON_PX: Final = 32
# Of the task figure, what lies above its equations.
FRAMES_UNITS: Final = 232


def example() -> tuple[Clip, Clip, list[float]]:
    """Two sequences of the example, and their times to contact in seconds."""
    folder, cache = read_folder(FOLDER), ImageCache()
    near, far = (folder.clip(row, cache=cache) for row in (0, 1))
    return near, far, read_truth(FOLDER / "truth.csv").ttc_s[:2].tolist()


def figures() -> dict[Path, Figure]:
    """Each figure with its file."""
    near, far, (near_s, far_s) = example()
    frames = [near.colour(frame) for frame in range(6)]
    return {
        FIGURES / "task.svg": task_figure(frames, boxes=near.boxes, ttc_s=near_s),
        **{
            FIGURES / f"baseline-{name}.svg": search_figure(
                clip, estimator=PixelMse(), frame_gap=5, true_ttc_s=ttc_s
            )
            for name, clip, ttc_s in (("near", near, near_s), ("far", far, far_s))
        },
        FIGURES / "annotation-consensus.svg": consensus_figure(),
        FIGURES / "annotation-choice.svg": choice_figure(),
        **{
            FIGURES / f"deep-scale-{name}.svg": confidence_figure(
                clip, estimator=DeepScale(), frame_gap=5, true_ttc_s=ttc_s
            )
            for name, clip, ttc_s in (("near", near, near_s), ("far", far, far_s))
        },
        **{
            STATIC / "task" / f"{size}-{theme}.svg": task_figure(
                frames, boxes=near.boxes, ttc_s=near_s, theme=theme, n_columns=n_columns
            )
            for size, n_columns in COLUMNS.items()
            for theme in THEMES
        },
    }


def icon() -> bytes:
    """The site's sign for what asks for /favicon.ico: one picture of 32 × 32 pixels."""
    colours = THEMES["light"]
    figure = Figure(ICON_PX // 2, ICON_PX // 2, colours, "TSTTC")
    corners = [((1.5, 1.5), (6, 6)), ((14.5, 1.5), (10, 6)), ((1.5, 14.5), (6, 10)), ((14.5, 14.5), (10, 10))]
    figure.shapes += [Line(list(ends), colours.quiet, 0.75) for ends in corners]
    figure.shapes += [
        outline([edge, edge, 16 - edge, 16 - edge], colour=colours.accent, width=1.5) for edge in (1, 5.75)
    ]
    png = figure.png()
    # One entry: width, height, no palette, one plane, 32 bits, size and place of the PNG.
    header = struct.pack("<HHHBBBBHHII", 0, 1, 1, ICON_PX, ICON_PX, 0, 0, 1, 32, len(png), 22)
    return header + png


def card() -> bytes:
    """What links show where a page has no picture of its own: 1200 × 630 pixels, as JPEG."""
    near, _, (near_s, _) = example()
    strip = task_figure([near.colour(frame) for frame in range(6)], boxes=near.boxes, ttc_s=near_s)
    pixels = strip.pixels()[: FRAMES_UNITS * PNG_SCALE]
    figure = Figure(600, 315, strip.theme, "TSTTC: time-to-contact benchmark")
    colours, margin = figure.theme, 24
    width = figure.width - 2 * margin
    height = width * FRAMES_UNITS / strip.width
    figure.shapes += [
        Text("How long until contact?", margin, 66, colours.ink, size=38, is_bold=True),
        Text("TSTTC, the benchmark of time-to-contact estimation", margin, 98, colours.quiet, size=18),
        Picture(pixels, margin, 136, width, height),
        Text(
            "Six frames in, seconds out: ranked results with confidence intervals",
            margin,
            288,
            colours.accent,
            size=15,
        ),
    ]
    return encoded(figure.pixels(), ".jpg")


def draw() -> None:
    """Write every figure to its file."""
    for path, figure in figures().items():
        path.parent.mkdir(exist_ok=True)
        on_web = path.is_relative_to(STATIC)
        path.write_text(
            figure.svg(jpeg_quality=WEB_JPEG_QUALITY if on_web else JPEG_QUALITY), encoding="utf-8"
        )
    (STATIC / "favicon.ico").write_bytes(icon())
    (STATIC / "card.jpg").write_bytes(card())


if __name__ == "__main__":
    draw()
