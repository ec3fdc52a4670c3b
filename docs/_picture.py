"""Draw docs/figures/architecture.svg from the imports of the code: `python -m docs._picture`.

The other figures there, drawn by `tsttc baseline show`, get the colours of a dark page beside their own.

The rows are the layers of `pyproject.toml`, the arrows are imports between rooms. An import that a longer way
of arrows shows as well is left out, else the picture would be a thicket.
"""

import ast
import tomllib
from collections.abc import Mapping
from dataclasses import astuple
from html import escape
from pathlib import Path

import grimp

from tsttc_baselines.drawing import THEMES

REPOSITORY = Path(__file__).resolve().parent.parent
PICTURE = REPOSITORY / "docs" / "figures" / "architecture.svg"
CONTRACT = "the leaderboard's rooms import downwards"
WIDTH, ROW, BOX_HEIGHT, CHARACTER, GAP = 980, 84, 34, 8.4, 22

Imports = Mapping[str, set[str]]

STYLE = """
  text { font: 14px ui-monospace, monospace; fill: #1a1a1a; text-anchor: middle }
  .room { fill: #eef4f4; stroke: #0b7285 } .file { fill: #ffffff; stroke: #888 }
  path { fill: none; stroke: #0b7285; stroke-opacity: .55; marker-end: url(#tip) }
  marker path { fill: #0b7285 }
  @media (prefers-color-scheme: dark) {
    text { fill: #e6e6e6 } .room { fill: #12313a; stroke: #66c2d1 } .file { fill: #1c1c1c; stroke: #888 }
    path { stroke: #66c2d1 } marker path { fill: #66c2d1 }
  }
"""


def rows() -> list[list[str]]:
    """The rooms, one list for each layer, the highest first."""
    config = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = config["tool"]["importlinter"]["contracts"]
    layers = next(contract["layers"] for contract in contracts if contract["name"] == CONTRACT)
    return [[room.strip() for room in layer.split("|")] for layer in layers]


def imports(rooms: set[str]) -> Imports:
    """For each room the rooms that it imports."""
    graph = grimp.build_graph("leaderboard", cache_dir=None)
    for room in rooms:
        graph.squash_module(f"leaderboard.{room}")
    return {
        room: {
            name.removeprefix("leaderboard.")
            for name in graph.find_modules_directly_imported_by(f"leaderboard.{room}")
        }
        & (rooms - {room})
        for room in rooms
    }


def reduced(arrows: Imports) -> dict[str, set[str]]:
    """The same without the arrows that a longer way shows as well."""

    def reached(room: str) -> set[str]:
        return arrows[room].union(*(reached(other) for other in arrows[room]))

    return {
        room: {other for other in used if not any(other in reached(third) for third in used - {other})}
        for room, used in arrows.items()
    }


def svg() -> str:
    """The picture."""
    layers = rows()
    place: dict[str, tuple[float, float, float]] = {}  # the middle of a box, its top, its width
    for number, layer in enumerate(layers):
        widths = [len(room) * CHARACTER + 24 for room in layer]
        x = (WIDTH - sum(widths) - GAP * (len(layer) - 1)) / 2
        for room, width in zip(layer, widths, strict=True):
            place[room] = (x + width / 2, 12 + number * ROW, width)
            x += width + GAP
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {len(layers) * ROW - 26}" role="img">',
        "<title>The rooms of leaderboard/ and their imports, which run downwards</title>",
        f"<style>{STYLE}</style>",
        '<marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        '<path d="M0 1 L7 4 L0 7 z"/></marker>',
    ]
    for room, used in sorted(reduced(imports(set(place))).items()):
        x, y, _ = place[room]
        for other in sorted(used):
            to_x, to_y, _ = place[other]
            start, bend = y + BOX_HEIGHT, (to_y - y - BOX_HEIGHT) / 2
            first, second = f"{x:.0f} {start + bend:.0f}", f"{to_x:.0f} {to_y - bend:.0f}"
            lines.append(f'<path d="M{x:.0f} {start} C{first} {second} {to_x:.0f} {to_y}"/>')
    for room, (x, y, width) in place.items():
        kind = "room" if (REPOSITORY / "leaderboard" / room).is_dir() else "file"
        box = f'x="{x - width / 2:.0f}" y="{y}" width="{width:.0f}" height="{BOX_HEIGHT}" rx="6"'
        lines += [
            f'<rect class="{kind}" {box}><title>{escape(_purpose(room))}</title></rect>',
            f'<text x="{x:.0f}" y="{y + 22}">{room}</text>',
        ]
    return "\n".join([*lines, "</svg>\n"])


def _purpose(room: str) -> str:
    """The first line of its docstring."""
    path = REPOSITORY / "leaderboard" / room
    source = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return (ast.get_docstring(ast.parse(source.read_text(encoding="utf-8"))) or "").partition("\n")[0]


def with_both_schemes(drawn: str) -> str:
    """Let a figure in the light colours follow the reader's scheme."""
    light, dark = (astuple(THEMES[name]) for name in ("light", "dark"))
    rules = "".join(
        f'[fill="{old}"]{{fill:{new}}}[stroke="{old}"]{{stroke:{new}}}'
        for old, new in zip(light, dark, strict=True)
    )
    style = f"<style>@media (prefers-color-scheme:dark){{{rules}}}</style>"
    return drawn if style in drawn else drawn.replace("</title>", f"</title>\n{style}", 1)


if __name__ == "__main__":
    PICTURE.write_text(svg(), encoding="utf-8")
    for path in PICTURE.parent.glob("*.svg"):
        if path != PICTURE:
            path.write_text(with_both_schemes(path.read_text(encoding="utf-8")), encoding="utf-8")
