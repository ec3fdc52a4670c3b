"""Series of ECharts: marks, lines, whiskers, bands, bars and cells."""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from leaderboard.web.charts.chart_options import TEXT, Mark, Option, call

SERIES_INKS: Final = ("--s1", "--s2", "--s3", "--s4", "--s5")
# One shape for each series: nobody has to tell colours apart.
SERIES_SYMBOLS: Final = (
    "circle",
    "rect",
    "triangle",
    "diamond",
    "path://M0 2L2 0L5 3L8 0L10 2L7 5L10 8L8 10L5 7L2 10L0 8L3 5Z",
)


@dataclass(frozen=True)
class Look:
    ink: str = "--s1"
    symbol: str = "circle"
    size: float = 9.0
    is_hollow: bool = False

    def style(self) -> Option:
        # Hollow marks are filled with the ground, full ones have a rim of it, so that neighbours stay apart.
        if self.is_hollow:
            return {"color": "--ground", "borderColor": self.ink, "borderWidth": 1.25, "opacity": 1}
        return {"color": self.ink, "borderColor": "--ground", "borderWidth": 1, "opacity": 1}


def marks(name: str, points: Iterable[Mark], look: Look, *, grid: int = 0, z: int = 2) -> Option:
    shape = {"symbol": look.symbol, "symbolSize": look.size, "itemStyle": look.style()}
    return _read("scatter", name, points) | shape | {"xAxisIndex": grid, "yAxisIndex": grid, "z": z}


def _read(kind: str, name: str, points: Iterable[Mark]) -> Option:
    return {
        "type": kind,
        "name": name,
        "data": [mark.item() for mark in points],
        "emphasis": {"disabled": True},
        "cursor": "inherit",
    }


def named_marks(name: str, front: Sequence[Mark], chosen: Iterable[int], look: Look) -> Option:
    """Name the chosen marks of a front in the empty corner below each.

    Where names overlap, ECharts keeps those of larger marks: the later ones, by a hair.
    """
    indices = list(chosen)
    items = [{**front[i].item(), "symbolSize": look.size + 0.01 * i} for i in indices]
    for item, after in itertools.pairwise(items):
        if item["name"] == after["name"]:  # a method that improves on itself is named at its best
            item["label"] = {"show": False}
    corners = [None, *([mark.x, mark.y] for mark in front), None]
    beside = [[corners[i], corners[i + 2]] for i in indices]
    series = marks(name, (), look, z=4)
    label = {
        **TEXT,
        "show": True,
        "position": "bottom",
        "distance": 6,
        "align": "left",
        "formatter": call("name"),
        "textBorderColor": "--ground",
        "textBorderWidth": 6,  # wide enough to hide a grid line between two words
    }
    return series | {"data": items, "label": label, "labelLayout": call("below", beside)}


def staircase(name: str, corners: Iterable[tuple[float, float]]) -> Option:
    """Draw a line that changes only where something better comes."""
    return {
        "type": "line",
        "name": name,
        "step": "end",
        "showSymbol": False,
        "symbol": "none",
        "lineStyle": {"color": "--s1", "width": 2},
        "itemStyle": {"color": "--s1"},
        "data": [list(corner) for corner in corners],
        "emphasis": {"disabled": True},
        "silent": True,
        "z": 1,
    }


def line(
    name: str, points: Iterable[tuple[float, float]], ink: str, *, grid: int = 0, dash: str = "solid"
) -> Option:
    series = staircase(name, points)
    del series["step"]
    drawn = {"lineStyle": {"color": ink, "width": 1.5, "type": dash}, "itemStyle": {"color": ink}}
    return series | drawn | {"xAxisIndex": grid, "yAxisIndex": grid}


def whiskers(name: str, spans: Iterable[tuple[float, float, float]], ink: str, *, grid: int = 0) -> Option:
    return _custom("whisker", name, spans, ink, grid=grid)


def band(name: str, spans: Iterable[tuple[float, float, float]], ink: str, *, grid: int = 0) -> Option:
    return _custom("band", name, spans, ink, grid=grid) | {
        "itemStyle": {"color": ink, "opacity": 0.25},
        "z": 0,
    }


def strips(names: Iterable[int], y: float, *, grid: int) -> Option:
    """Draw a light strip behind these names of an axis, over the whole height; `y` is any value within it."""
    spans = [(i - 0.5, i + 0.5, y) for i in names]
    return _custom("strip", "", spans, "--tint", grid=grid) | {"encode": {"x": [0, 1], "y": 2}, "z": -1}


def _custom(
    function: str, name: str, spans: Iterable[tuple[float, float, float]], ink: str, *, grid: int
) -> Option:
    return {
        "type": "custom",
        "name": name,
        "xAxisIndex": grid,
        "yAxisIndex": grid,
        "renderItem": call(function, ink),
        "encode": {"x": 0, "y": [1, 2]},
        "data": [list(span) for span in spans],
        "itemStyle": {"color": ink},
        "clip": True,
        "silent": True,
        "z": 1,
    }


def cells(name: str, points: Iterable[Mark], ink: str) -> Option:
    series = _read("heatmap", name, points)
    for item in series["data"]:
        item["value"].append(0)  # ECharts draws no cell without a third value
    return series | {"itemStyle": {"color": ink, "borderColor": "--ground", "borderWidth": 1}}


def bars(name: str, points: Iterable[Mark], ink: str) -> Option:
    series = _read("bar", name, points)
    return series | {"barCategoryGap": "12%", "itemStyle": {"color": ink}, "upright": True}
