"""Draws a card as PNG, 1200 × 630 pixels: what other sites show of a link.

The font is DejaVu Sans (`fonts/`), which has Latin, Greek and Cyrillic. A card with a letter that it lacks is
not drawn: boxes in place of a name would help nobody.
"""

from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import Final

from PIL import Image, ImageDraw, ImageFont

from leaderboard.exports.cards import Card

WIDTH_PX: Final = 1200
HEIGHT_PX: Final = 630
_MARGIN_PX: Final = 72
_GROUND, _INK, _QUIET, _HAIR, _ACCENT = "#ffffff", "#14181c", "#5d6771", "#dde2e6", "#00666e"
_FONT: Final = Path(__file__).parent / "fonts" / "DejaVuSans.ttf"
_TITLE_PX, _SMALLEST_PX, _TEXT_PX, _ROW_PX = 68, 44, 32, 38
_N_COLOURS: Final = 32
# No font has a glyph for it.
_NOWHERE: Final = "\U0010ffff"


def png(card: Card) -> bytes:
    """The card as a picture; nothing if the font lacks one of its letters."""
    texts = [
        card.title,
        card.subtitle,
        *(text for row in card.rows for text in (row.rank, row.name, row.value)),
    ]
    if not all(map(_has_glyph, set("".join(texts)))):
        return b""
    image = Image.new("RGB", (WIDTH_PX, HEIGHT_PX), _GROUND)
    draw = ImageDraw.Draw(image)
    draw.rectangle((0, 0, 16, HEIGHT_PX), fill=_ACCENT)
    _draw_sign(draw)
    _draw_head(draw, card)
    for i, row in enumerate(card.rows):
        y = 300 + 76 * i
        draw.line((_MARGIN_PX, y, WIDTH_PX - _MARGIN_PX, y), fill=_HAIR, width=2)
        _draw_row(draw, row.rank, row.name, row.value, y=y + 56)
    footer = "TSTTC leaderboard · time to contact, lower is better"
    draw.text((_MARGIN_PX, HEIGHT_PX - 48), footer, font=_font(26), fill=_QUIET, anchor="ls")
    found = BytesIO()
    image.quantize(_N_COLOURS).save(found, format="PNG", optimize=True)
    return found.getvalue()


def _draw_head(draw: ImageDraw.ImageDraw, card: Card) -> None:
    room = WIDTH_PX - 2 * _MARGIN_PX - 110
    size = next(
        (size for size in range(_TITLE_PX, _SMALLEST_PX, -4) if _font(size).getlength(card.title) <= room),
        _SMALLEST_PX,
    )
    title = _cut(card.title, size=size, room=room)
    draw.text((_MARGIN_PX, 148), title, font=_font(size), fill=_INK, anchor="ls")
    subtitle = _cut(card.subtitle, size=_TEXT_PX, room=WIDTH_PX - 2 * _MARGIN_PX)
    draw.text((_MARGIN_PX, 212), subtitle, font=_font(_TEXT_PX), fill=_QUIET, anchor="ls")


def _draw_row(draw: ImageDraw.ImageDraw, rank: str, name: str, value: str, *, y: int) -> None:
    font, right = _font(_ROW_PX), WIDTH_PX - _MARGIN_PX
    left = _MARGIN_PX + max(60, round(font.getlength(rank)) + 24)
    draw.text((_MARGIN_PX, y), rank, font=font, fill=_ACCENT, anchor="ls")
    name = _cut(name, size=_ROW_PX, room=right - left - font.getlength(value) - 32)
    draw.text((left, y), name, font=font, fill=_INK, anchor="ls")
    draw.text((right, y), value, font=font, fill=_INK, anchor="rs")


def _draw_sign(draw: ImageDraw.ImageDraw) -> None:
    """The site's sign, a box that comes nearer."""
    left, top, side = WIDTH_PX - _MARGIN_PX - 84, 76, 84
    for x, y in ((0, 0), (1, 0), (0, 1), (1, 1)):
        corner = (left + x * side, top + y * side)
        inner = (left + side * (1 / 3 + x / 3), top + side * (1 / 3 + y / 3))
        draw.line((corner, inner), fill=_QUIET, width=4)
    draw.rectangle((left, top, left + side, top + side), outline=_ACCENT, width=7)
    third = side / 3
    draw.rectangle((left + third, top + third, left + 2 * third, top + 2 * third), outline=_ACCENT, width=7)


def _cut(text: str, *, size: int, room: float) -> str:
    """The text, or as much of its beginning as there is room for."""
    font = _font(size)
    if font.getlength(text) <= room:
        return text
    n = next((n for n in range(len(text), 0, -1) if font.getlength(f"{text[:n].rstrip()}…") <= room), 0)
    return f"{text[:n].rstrip()}…"


@lru_cache(maxsize=16)
def _font(size: int) -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(_FONT, size, layout_engine=ImageFont.Layout.BASIC)


@lru_cache(maxsize=4096)
def _has_glyph(character: str) -> bool:
    font = _font(_TEXT_PX)
    return character.isspace() or bytes(font.getmask(character)) != bytes(font.getmask(_NOWHERE))
