"""Charts as options for Apache ECharts, from the numbers of the table next to each.

`static/charts.js` draws them: "--accent" is the page's colour of that name, `call("names", …)` a function of
that script. `read` are a mark's lines for the reader, `href` the target of a click.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from django.urls import reverse

from evaluator.metrics.registry import Metric
from evaluator.scoring.results import format_rounded
from leaderboard.boards.rows import Entry
from leaderboard.web.charts import svg

Option = dict[str, Any]

# Straight from 0 as long as the largest error is at most so many times the smallest.
_MAX_STRAIGHT: Final = 6.0
NARROW_PX: Final = 600
# Of a legend: px of its line, and of a name in it.
_LEGEND_PX: Final = {"wide": (NARROW_PX, 480), "narrow": (348, 310), "narrowest": (290, 250)}
# Where panels stand one above the other: their height in site.css by how many they are; what is above each.
_STACKED_PX: Final = {2: 704, 3: 896}
_HEAD_PX: Final = 50
_BETWEEN: Final = (1.2, 1.5, 3, 4, 6, 8)
_LEFT_PX: Final = 44
# So many ranks stand beside each other on a phone; of more, it leaves some out.
_MAX_RANKS: Final = 13
QUIET: Final = {"color": "--quiet", "fontSize": 11, "lineHeight": 14}
TEXT: Final = {"color": "--ink", "fontSize": 12}


@dataclass(frozen=True)
class Chart:
    """A chart: ECharts options, and the table with the same numbers."""

    kind: str
    label: str  # what it shows, for those who cannot see it
    options: Mapping[str, Any]
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numbers: tuple[int, ...] = ()  # which columns hold numbers of their own, from 0: they stand at the right
    has_intervals: bool = False
    is_zoomable: bool = False
    is_low: bool = False  # it has so little in it that half the height will do
    note: str = ""  # in a sentence, what it leaves out

    @property
    def headings(self) -> list[tuple[str, str]]:
        """Return the columns, each with its class."""
        return [(text, "number" if i in self.numbers else "") for i, text in enumerate(self.columns)]

    @property
    def table_rows(self) -> list[list[tuple[str, str]]]:
        """Return the rows, each text with the class of its cell."""
        css = ["number" if i in self.numbers else "" for i in range(len(self.columns))]
        if css and not css[0]:
            css[0] = "first"
        return [list(zip(row, css, strict=True)) for row in self.rows]

    @property
    def n_panels(self) -> int:
        return len(self.options["baseOption"]["yAxis"])

    @property
    def has_links(self) -> bool:
        series = self.options["baseOption"]["series"]
        return any("href" in mark for each in series for mark in each["data"])

    def __bool__(self) -> bool:
        return bool(self.rows)


@dataclass(frozen=True)
class Mark:
    """A point of a chart: position, lines for the reader, target of a click."""

    x: float
    y: float
    read: tuple[str, ...]
    href: str = ""

    def item(self) -> Option:
        option: Option = {"value": [self.x, self.y], "name": self.read[0], "read": list(self.read[1:])}
        return option | ({"href": self.href} if self.href else {})


def empty(kind: str) -> Chart:
    return Chart(kind=kind, label="", options={}, columns=(), rows=())


def call(name: str, of: Any = None) -> Option:
    """Refer to a function of `static/charts.js`."""
    return {"call": name, "of": of}


def method_href(entry: Entry) -> str:
    """Return the page of an entry's method; empty for a published result."""
    return reverse("method", args=[entry.method_id]) if entry.method_id else ""


def error_text(metric: Metric, value: float | None, *, decimals: int) -> str:
    """Format a value with its symbol, as `MiD 14.30`."""
    return f"{metric.symbol} {format_rounded(value, decimals=decimals)}"


# --- axes ------------------------------------------------------------------------------------------------


def round_range(low: float, high: float) -> tuple[float, float]:
    """Return the last of …, 1, 2, 5, 10, … at or below `low`, and the first at or above `high`.

    >>> round_range(13.0, 41.0), round_range(20.0, 20.0)
    ((10.0, 50.0), (20.0, 50.0))
    """
    steps = _round_numbers(low / 10, high * 10)
    first = max(step for step in steps if step <= low * (1 + 1e-9))
    return first, min(step for step in steps if step >= high * (1 - 1e-9) and step > first)


def _round_numbers(low: float, high: float) -> list[float]:
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    return [float(f"{factor}e{power}") for power in powers for factor in (1, 2, 5)]


def log_axis(values: Iterable[float], *, room: float = 0.0) -> Option:
    """Make a logarithmic axis; `room` is the least free part below the values, for names."""
    known = list(values)
    low, high = round_range(min(known), max(known))
    while room and math.log(min(known) / low) < room * math.log(high / low):
        low, _ = round_range(0.9 * low, high)
    within = [step for step in _round_numbers(low, high) if low <= step <= high]
    if len(within) == 2:  # two names at the ends leave the middle without any
        within = sorted({*within, *(factor * 10 ** math.floor(math.log10(low)) for factor in _BETWEEN)})
        within = [step for step in within if low <= step <= high]
    if len(within) > 10:  # several decades: their beginnings are enough
        within = [step for step in within if math.log10(step) % 1 < 1e-9]
    ticks = {"customValues": within}
    return {"type": "log", "min": low, "max": high, "axisLabel": ticks, "axisTick": ticks}


def error_axis(
    metric: Metric, values: Iterable[float], *, room: float = 0.0, is_near: bool = False
) -> Option:
    """Make an axis of errors from 0, or from near the values, or logarithmic and labelled so."""
    known = list(values) or [1.0]
    name = f"{metric.symbol}, {metric.unit}".rstrip(", ")
    if min(known) <= 0 or max(known) <= _MAX_STRAIGHT * min(known):
        if is_near:
            ends = svg.round_ticks(min(known), max(known), n=4)
            step = round(ends[1] - ends[0], 10)
            return y_axis(name, {"type": "value", "min": ends[0], "max": ends[-1], "interval": step})
        return y_axis(name, {"type": "value", "min": 0})
    return y_axis(f"{name} (log scale)", log_axis(known, room=room))


def y_axis(name: str, axis: Mapping[str, Any]) -> Option:
    """Add name and grid lines to an upright axis."""
    return _styled(axis) | {
        "name": name,
        "nameLocation": "end",
        "nameGap": 12,
        "nameTextStyle": {"color": "--soft", "fontSize": 12, "align": "left", "padding": [0, 0, 0, -34]},
        "axisLine": {"show": False, "onZero": False},
        "splitLine": {"show": True, "lineStyle": {"color": "--hair"}},
    }


def x_axis(name: str, axis: Mapping[str, Any]) -> Option:
    return _styled(axis) | {
        "name": name,
        "nameLocation": "middle",
        "nameGap": 28,
        "nameTextStyle": {"color": "--soft", "fontSize": 12},
        "axisLine": {"lineStyle": {"color": "--rule"}, "onZero": False},
        "splitLine": {"show": False},
    }


def _styled(axis: Mapping[str, Any]) -> Option:
    label = {**QUIET, "hideOverlap": True, **axis.get("axisLabel", {})}
    tick = {"show": True, "length": 4, "lineStyle": {"color": "--rule"}, **axis.get("axisTick", {})}
    return {**axis, "axisLabel": label, "axisTick": tick}


def ticks_axis(ticks: Sequence[tuple[float, str]], *, low: float, high: float) -> Option:
    """Make an axis with texts at these values."""
    at = {"customValues": [tick for tick, _ in ticks]}
    label = {**at, "formatter": call("texts", [list(tick) for tick in ticks])}
    return {"type": "value", "min": low, "max": high, "axisLabel": label, "axisTick": at}


def names_axis(names: Sequence[str]) -> Option:
    return ticks_axis(list(enumerate(names)), low=-0.5, high=len(names) - 0.5)


def ranks_axis(names: Sequence[str], *, name: str = "", is_upright: bool = False) -> Option:
    """Make an axis of a heat map, at the left or above."""
    label: Option = {**QUIET} | ({"interval": 0} if len(names) <= _MAX_RANKS else {})
    if is_upright:
        label = {**TEXT, "interval": 0, "overflow": "truncate", "ellipsis": "…"}
    hidden = {"show": False}
    axis = {
        "type": "category",
        "data": list(names),
        "axisLabel": label,
        "axisTick": hidden,
        "axisLine": hidden,
    }
    if is_upright:
        return axis | {"inverse": True}
    title = {"name": name, "nameLocation": "middle", "nameGap": 22, "nameTextStyle": {"color": "--soft"}}
    return axis | title | {"position": "top"}


# --- the whole -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Frame:
    """The axes of a chart, a pair for each panel, and its series."""

    x_axes: Sequence[Option]
    y_axes: Sequence[Option]
    series: Sequence[Option]
    names: Sequence[str] = ()  # of the legend
    keys: Mapping[str, str] = field(default_factory=dict)  # of these names in it, in place of their own
    further_x_axes: Sequence[Option] = ()  # of the last panel
    left: tuple[int, int] = (
        _LEFT_PX,
        _LEFT_PX,
    )  # px before the ground, where it is wide and where it is narrow
    top: int = 0  # px more than usual above it
    more: Mapping[str, Any] = field(default_factory=dict)
    # What differs in each series where it is wide, and where it is narrow.
    series_by_width: tuple[Sequence[Option], Sequence[Option]] = ((), ())
    y_labels_by_width: tuple[Option, Option] = ({}, {})

    def options(self) -> Option:
        """Return the options of panels side by side, which stack on a narrow screen."""
        n_panels = len(self.x_axes)
        base = {
            "animation": False,
            "useUTC": True,
            "textStyle": {"color": "--ink"},
            "xAxis": [
                *({**axis, "gridIndex": i} for i, axis in enumerate(self.x_axes)),
                *({**axis, "gridIndex": n_panels - 1, "position": "bottom"} for axis in self.further_x_axes),
            ],
            "yAxis": [{**axis, "gridIndex": i} for i, axis in enumerate(self.y_axes)],
            "series": list(self.series),
            **self.more,
        }
        narrow = {"maxWidth": max(NARROW_PX, NARROW_PX * n_panels // 2)}
        media: list[Option] = [
            {"option": self._layout(n_panels, width="wide")},
            {"query": narrow, "option": self._layout(n_panels, width="narrow")},
            # A legend has more lines in the narrowest windows.
            {"query": {"maxWidth": 350}, "option": self._layout(n_panels, width="narrowest")},
        ]
        return {"baseOption": base, "media": media}

    def _layout(self, n_panels: int, *, width: str) -> Option:
        is_narrow = width != "wide"
        left = self.left[is_narrow]
        line_px, name_px = _LEGEND_PX[width]
        if not is_narrow:
            line_px = max(line_px, NARROW_PX * n_panels // 2)
        top = 38 + self.top + 24 * self._n_legend_lines(line_px, name_px)
        layout = {
            "legend": self._legend(name_px),
            "grid": _grids(n_panels, left=left, top=top, is_narrow=is_narrow),
        }
        if self.series_by_width[is_narrow]:
            layout["series"] = list(self.series_by_width[is_narrow])
        if left == _LEFT_PX:
            return layout
        return layout | {
            "yAxis": [
                {"axisLabel": {"width": left - 16, **self.y_labels_by_width[is_narrow]}} for _ in self.y_axes
            ]
        }

    def _n_legend_lines(self, width_px: int, name_px: int) -> int:
        # A little more than half an em for each letter.
        n_lines, used_px = 0, float(width_px)
        for name in self.names:
            needed_px = 33 + min(name_px, 6.4 * len(name))
            if used_px + needed_px > width_px:
                n_lines, used_px = n_lines + 1, 0.0
            used_px += needed_px
        return n_lines

    def _legend(self, name_px: int) -> Option:
        return {
            "show": bool(self.names),
            "data": [
                {"name": name, "icon": self.keys[name]} if name in self.keys else name for name in self.names
            ],
            "left": 0,
            "top": 0,
            "itemGap": 14,
            "itemWidth": 14,
            "itemHeight": 10,
            "textStyle": {**TEXT, "width": name_px, "overflow": "truncate"},
            "inactiveColor": "--rule",
        }


def _grids(n_panels: int, *, left: int, top: int, is_narrow: bool) -> list[Option]:
    sides = {"left": left, "right": 12, "bottom": 44 if left == _LEFT_PX else 8}
    before, after = ("top", "bottom") if is_narrow else ("left", "right")
    gap = 6 if is_narrow else 3  # per cent beside the border of two panels
    grids: list[Option] = [{**sides, "top": top} for _ in range(n_panels)]
    # The legend takes its height from all panels, not from the first alone.
    legend = 100 * (top - _HEAD_PX) / _STACKED_PX.get(n_panels, 896) if is_narrow else 0.0
    for number in range(1, n_panels):
        border = legend + (100 - legend) * number / n_panels
        grids[number - 1][after] = f"{100 - border + gap:.0f}%"
        grids[number][before] = f"{border + gap:.0f}%"
    return grids
