"""Small figures as lists of shapes, written alike as SVG or PNG, in pixels from the top left corner."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Final, Literal

import cv2
import numpy as np

from tsttc_baselines.clips import Image

FONT: Final = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Liberation Sans', Arial, sans-serif"
PNG_SCALE: Final = 2
_JPEG_QUALITY: Final = 88

Anchor = Literal["start", "middle", "end"]


@dataclass(frozen=True, slots=True)
class Theme:
    ground: str
    ink: str
    quiet: str
    hair: str
    accent: str
    mark: str


THEMES: Final[dict[str, Theme]] = {
    "light": Theme("#ffffff", "#14181c", "#5d6771", "#dde2e6", "#00666e", "#c4461f"),
    "dark": Theme("#0f1215", "#e6e9ec", "#97a1ab", "#272d33", "#5cc8cf", "#ffa07a"),
}


@dataclass(frozen=True, slots=True)
class Picture:
    """Pixels, grey or blue first, stretched over a rectangle."""

    pixels: Image
    x: float
    y: float
    width: float
    height: float


@dataclass(frozen=True, slots=True)
class Line:
    points: Sequence[tuple[float, float]]
    colour: str
    width: float = 1.0
    closed: bool = False


@dataclass(frozen=True, slots=True)
class Dot:
    x: float
    y: float
    radius: float
    colour: str


@dataclass(frozen=True, slots=True)
class Text:
    text: str
    x: float
    y: float
    colour: str
    size: float = 13.0
    anchor: Anchor = "start"
    is_bold: bool = False


Shape = Picture | Line | Dot | Text


def outline(box: Sequence[float], *, colour: str, width: float = 2.0) -> Line:
    x1, y1, x2, y2 = box
    return Line([(x1, y1), (x2, y1), (x2, y2), (x1, y2)], colour, width, closed=True)


@dataclass(slots=True)
class Figure:
    """A figure with its description in words; later shapes cover earlier ones."""

    width: int
    height: int
    theme: Theme
    title: str
    shapes: list[Shape] = field(default_factory=list)

    def svg(self) -> str:
        """Write SVG with its pictures inside, without scripts, styles or references."""
        lines = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {self.width} {self.height}" '
            f'width="{self.width}" height="{self.height}" role="img" font-family="{FONT}">',
            f"<title>{escape(self.title)}</title>",
            f'<rect width="{self.width}" height="{self.height}" fill="{self.theme.ground}"/>',
            *map(_svg_of, self.shapes),
            "</svg>",
        ]
        return "\n".join(lines) + "\n"

    def _pixels(self) -> Image:
        shape = (self.height * PNG_SCALE, self.width * PNG_SCALE, 3)
        canvas: Image = np.full(shape, _bgr(self.theme.ground), dtype=np.uint8)
        for each in self.shapes:
            _paint(canvas, each)
        return canvas

    def png(self) -> bytes:
        return _encoded(self._pixels(), ".png")


def _encoded(pixels: Image, ending: str) -> bytes:
    options = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY] if ending == ".jpg" else []
    done, data = cv2.imencode(ending, pixels, options)
    if not done:
        raise ArithmeticError(f"OpenCV cannot encode an image of shape {pixels.shape}.")
    return data.tobytes()


# --- SVG ---------------------------------------------------------------------------------------------------


def _svg_of(shape: Shape) -> str:
    match shape:
        case Picture():
            data = base64.b64encode(_encoded(shape.pixels, ".jpg")).decode()
            return (
                f'<image x="{shape.x:g}" y="{shape.y:g}" width="{shape.width:g}" height="{shape.height:g}" '
                f'preserveAspectRatio="none" href="data:image/jpeg;base64,{data}"/>'
            )
        case Line():
            points = " ".join(f"{x:.2f},{y:.2f}" for x, y in shape.points)
            name = "polygon" if shape.closed else "polyline"
            return (
                f'<{name} points="{points}" fill="none" stroke="{shape.colour}" '
                f'stroke-width="{shape.width:g}" stroke-linejoin="round"/>'
            )
        case Dot():
            return (
                f'<circle cx="{shape.x:.2f}" cy="{shape.y:.2f}" r="{shape.radius:g}" fill="{shape.colour}"/>'
            )
        case Text():
            weight = ' font-weight="700"' if shape.is_bold else ""
            return (
                f'<text x="{shape.x:.2f}" y="{shape.y:.2f}" fill="{shape.colour}" font-size="{shape.size:g}" '
                f'text-anchor="{shape.anchor}"{weight}>{escape(shape.text)}</text>'
            )


# --- PNG ---------------------------------------------------------------------------------------------------

_FRACTION_BITS: Final = 4  # OpenCV takes places as integers, sixteenths of a pixel here


def _paint(canvas: Image, shape: Shape) -> None:
    match shape:
        case Picture():
            _paint_picture(canvas, shape)
        case Line():
            points = np.array([[_fixed(x), _fixed(y)] for x, y in shape.points], dtype=np.int32)
            width = max(1, round(shape.width * PNG_SCALE))
            colour = _bgr(shape.colour)
            cv2.polylines(
                canvas, [points], shape.closed, colour, width, lineType=cv2.LINE_AA, shift=_FRACTION_BITS
            )
        case Dot():
            centre = (_fixed(shape.x), _fixed(shape.y))
            radius, colour = _fixed(shape.radius), _bgr(shape.colour)
            cv2.circle(canvas, centre, radius, colour, -1, lineType=cv2.LINE_AA, shift=_FRACTION_BITS)
        case Text():
            _write(canvas, shape)


def _paint_picture(canvas: Image, picture: Picture) -> None:
    left, top = round(picture.x * PNG_SCALE), round(picture.y * PNG_SCALE)
    size = (round(picture.width * PNG_SCALE), round(picture.height * PNG_SCALE))
    pixels = picture.pixels if picture.pixels.ndim == 3 else cv2.cvtColor(picture.pixels, cv2.COLOR_GRAY2BGR)
    way = cv2.INTER_AREA if size[0] < pixels.shape[1] else cv2.INTER_CUBIC
    canvas[top : top + size[1], left : left + size[0]] = cv2.resize(pixels, size, interpolation=way)


def _write(canvas: Image, text: Text) -> None:
    size = round(text.size * PNG_SCALE)
    share = {"start": 0.0, "middle": 0.5, "end": 1.0}[text.anchor]
    colour = _bgr(text.colour)
    if hasattr(cv2, "FontFace"):  # OpenCV 5 brings a typeface
        face, weight = cv2.FontFace("sans"), 700 if text.is_bold else 400
        _, _, width, _ = cv2.getTextSize((0, 0), text.text, (0, 0), face, size, weight)
        origin = (round(text.x * PNG_SCALE - share * width), round(text.y * PNG_SCALE))
        cv2.putText(canvas, text.text, origin, colour, face, size, weight)
        return
    plain = text.text.replace("α", "scale ratio").replace("τ", "TTC").encode("ascii", "replace").decode()
    scale, thickness = size / 30, 2 if text.is_bold else 1
    (width, _), _ = cv2.getTextSize(plain, cv2.FONT_HERSHEY_SIMPLEX, scale, thickness)
    origin = (round(text.x * PNG_SCALE - share * width), round(text.y * PNG_SCALE))
    cv2.putText(canvas, plain, origin, cv2.FONT_HERSHEY_SIMPLEX, scale, colour, thickness, cv2.LINE_AA)


def _fixed(value: float) -> int:
    return round(value * PNG_SCALE * 2**_FRACTION_BITS)


def _bgr(colour: str) -> tuple[int, int, int]:
    """Convert a colour for OpenCV.

    >>> _bgr("#00666e")
    (110, 102, 0)
    """
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return blue, green, red
