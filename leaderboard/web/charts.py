"""Charts made on the server, from what everybody's board says: each with a table that says the same.

They are SVG that takes colours from the page, so they print, turn dark with it and need no script. Where one
runs, `static/charts.js` lays the vendored library over those in which looking closer helps. Hidden splits
show nothing here that their board does not: values over whole intervals.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime
from typing import Final

from django.utils.html import format_html
from django.utils.safestring import SafeString

from evaluator.protocol import SCORE_NAMES
from evaluator.report import format_published
from leaderboard.entries import Interval
from leaderboard.exports import short_authors
from leaderboard.present import Attempt
from leaderboard.standings import Entry
from leaderboard.web.chart_frames import Frame, decade_ticks, log_ground
from leaderboard.web.drawing import round_ticks
from leaderboard.web.tables import (
    METRIC_SYMBOLS,
    METRIC_UNITS,
    figure_css,
    interval_words,
    rank_range,
)

# One shape for each series: nobody has to tell colours apart.
_SHAPES: Final = (
    "M{x} {y}m-4 0a4 4 0 1 0 8 0a4 4 0 1 0-8 0",
    "M{x} {y}m-3.6-3.6h7.2v7.2h-7.2z",
    "M{x} {y}m0-4.8l4.6 8.2h-9.2z",
    "M{x} {y}m0-5l5 5l-5 5l-5-5z",
    "M{x} {y}m-3.6-3.6l7.2 7.2m0-7.2l-7.2 7.2",
)


@dataclass(frozen=True)
class Point:
    """One row of a chart's table, and where it stands: x is a time in s, or a latency in ms."""

    texts: tuple[str, ...]
    x: float | None = None
    y: float | None = None
    label: str = ""
    decimals: int = 2  # of y
    is_marked: bool = False  # on the line: the best until then, or on the front


@dataclass(frozen=True)
class Series:
    """One method of a chart, and how it is drawn."""

    css: str
    label: str
    sample: SafeString


@dataclass(frozen=True)
class Chart:
    """A chart ready to be placed: its drawings, who is who in them, and the table behind."""

    kind: str
    panels: tuple[tuple[str, SafeString], ...]  # caption and drawing
    columns: tuple[str, ...]
    points: tuple[Point, ...]
    series: tuple[Series, ...] = ()
    numbers: tuple[int, ...] = ()  # which columns hold numbers of their own, from 0: they stand at the right

    @property
    def is_live(self) -> bool:
        """Whether a script may lay a chart over it that can be looked at closer."""
        return any(point.x is not None for point in self.points)

    @property
    def has_spans(self) -> bool:
        """Whether anything in it has an interval."""
        return any(" to " in text for point in self.points for text in point.texts)

    def __bool__(self) -> bool:
        """Whether there is anything to be drawn: an empty chart is never shown."""
        return bool(self.panels)


# --- the profile over the intervals ----------------------------------------------------------------------


def profile(entries: Sequence[Entry]) -> Chart:
    """Values with their intervals over the ranges of time to contact, up to five methods side by side."""
    shown = [entry for entry in entries if entry.scores["mid"] is not None][: len(_SHAPES)]
    if not shown:
        return Chart(kind="profile", panels=(), columns=(), points=())
    series = tuple(
        Series(css=f"s{i + 1}", label=_series_label(entry), sample=_sample(i))
        for i, entry in enumerate(shown)
    )
    panels = tuple(
        (f"{symbol}, {METRIC_UNITS[metric]}", _profile_panel(metric, shown))
        for metric, symbol in METRIC_SYMBOLS.items()
    )
    # As if all had the most decimals: the others keep the room of the missing one.
    most = max(entry.decimals for entry in shown)
    css = figure_css(
        format_published(entry.scores[name], decimals=most) for entry in shown for name in SCORE_NAMES
    )
    points = tuple(
        Point(
            (
                METRIC_SYMBOLS[name[:3]],
                name[4:] or "overall",
                *(_value_cell(entry, name, css, most) for entry in shown),
            )
        )
        for name in SCORE_NAMES
    )
    return Chart(
        kind="profile",
        panels=panels,
        columns=("Error", "Interval", *(entry.method for entry in shown)),
        points=points,
        series=series,
    )


def _series_label(entry: Entry) -> str:
    place = f" {rank_range(entry)}" if rank_range(entry) else ""
    return entry.method if entry.rank is None else f"{entry.method}, rank {entry.rank}{place}"


def _value_words(entry: Entry, name: str) -> str:
    words = interval_words(entry.intervals.get(name, Interval()), decimals=entry.decimals)
    value = format_published(entry.scores[name], decimals=entry.decimals)
    return f"{value} ({words})" if words else value


def _value_cell(entry: Entry, name: str, css: str, most: int) -> SafeString:
    """The same for a table; `css` gives what stands before the interval its width."""
    words = interval_words(entry.intervals.get(name, Interval()), decimals=entry.decimals)
    return format_html(
        '<span class="{}{}">{}</span>{}',
        css,
        _decimals_css(entry, most),
        format_published(entry.scores[name], decimals=entry.decimals),
        f" ({words})" if words else "",
    )


def _decimals_css(entry: Entry, most: int) -> str:
    return "" if entry.decimals == most else f" d{entry.decimals}"


def _mid_cell(entry: Entry, value: float, most: int) -> SafeString:
    text = format_published(value, decimals=entry.decimals)
    return format_html('<span class="{}">{}</span>', _decimals_css(entry, most).strip(), text)


def _profile_panel(metric: str, shown: Sequence[Entry]) -> SafeString:
    names = [name for name in SCORE_NAMES if name.startswith(metric)]
    values = [
        value
        for entry in shown
        for name in names
        for found in [entry.intervals.get(name, Interval())]
        for value in (entry.scores[name], found.low, found.high)
        if value is not None
    ]
    ticks = round_ticks(min(values), max(values), n=5)
    frame = Frame(360, 230, xs=(-0.5, len(names) - 0.5), ys=(ticks[0], ticks[-1]))
    parts = frame.rows(ticks)
    parts += [frame.column_label(i, name[4:] or "overall") for i, name in enumerate(names)]
    step = min(0.16, 0.7 / len(shown))
    for k, entry in enumerate(shown):
        offset = step * (k - (len(shown) - 1) / 2)
        marks = [_mark(frame, k, i + offset, entry, name) for i, name in enumerate(names)]
        parts.append(format_html('<g class="{}">{}</g>', f"s{k + 1}", SafeString("".join(marks))))
    return frame.svg(f"{METRIC_SYMBOLS[metric]} by interval; the table below says the same.", parts)


def _mark(frame: Frame, k: int, x: float, entry: Entry, name: str) -> SafeString:
    value = entry.scores[name]
    if value is None:
        return SafeString("")
    found = entry.intervals.get(name, Interval())
    path = ""
    if found.low is not None and found.high is not None:
        path = f"M{frame.x(x)} {frame.y(found.low)}V{frame.y(found.high)}"
    return format_html(
        '<g><title>{}</title><path class="span" d="{}"/><path class="mark" d="{}"/></g>',
        f"{entry.method}, {name[4:] or 'overall'}: {_value_words(entry, name)}",
        path,
        _SHAPES[k].format(x=frame.x(x), y=frame.y(value)),
    )


def _sample(k: int) -> SafeString:
    return format_html(
        '<svg class="sample {}" viewBox="0 0 14 14" aria-hidden="true"><path class="mark" d="{}"/></svg>',
        f"s{k + 1}",
        _SHAPES[k].format(x=7, y=7),
    )


# --- progress over time ----------------------------------------------------------------------------------


def progress(entries: Sequence[Entry], attempts: Iterable[Attempt] = ()) -> Chart:
    """The best MiD until each day: of every submission that stands, and of rows printed in papers.

    Rows printed in papers say a year and no day: they stand at its middle.
    """
    by_method = {entry.method_id: entry for entry in entries if entry.method_id is not None}
    dated = [
        (date(entry.year or 1, 7, 1), value, entry)
        for entry in entries
        if entry.kind == "published" and (value := entry.scores["mid"]) is not None
    ]
    dated += [
        (attempt.at.date(), attempt.mid, by_method[attempt.method_id])
        for attempt in attempts
        if attempt.mid is not None and attempt.method_id in by_method
    ]
    dated.sort(key=lambda item: item[:2])
    if not dated:
        return Chart(kind="progress", panels=(), columns=(), points=())
    best, most = math.inf, max(entry.decimals for _, _, entry in dated)
    points = []
    for day, value, entry in dated:
        is_record, best = value < best, min(best, value)
        points.append(
            Point(
                (
                    _day_text(day, entry),
                    entry.method,
                    _team(entry),
                    _mid_cell(entry, value, most),
                    "yes" if is_record else "",
                ),
                x=datetime(day.year, day.month, day.day, tzinfo=UTC).timestamp(),
                y=value,
                decimals=entry.decimals,
                label=f"{entry.method}, {_day_text(day, entry)}",
                is_marked=is_record,
            )
        )
    return Chart(
        kind="progress",
        panels=(("Motion-in-depth error (MiD), ×10⁻⁴, logarithmic, by date", _progress_panel(points)),),
        columns=("Date", "Method", "Team", "MiD ×10⁻⁴", "Best until then"),
        points=tuple(points),
        numbers=(3,),
    )


def _day_text(day: date, entry: Entry) -> str:
    return str(entry.year) if entry.kind == "published" else f"{day:%Y-%m-%d}"


def _team(entry: Entry) -> str:
    return short_authors(entry.team) if entry.kind == "published" else entry.team


def _progress_panel(points: Sequence[Point]) -> SafeString:
    xs, ys = [point.x or 0.0 for point in points], [math.log10(point.y or 1.0) for point in points]
    months = _month_ticks(min(xs), max(xs))
    frame, parts = log_ground(xs=(months[0][0], months[-1][0]), ys=ys)
    parts += [frame.column_label(at_s, text) for at_s, text in months]
    return frame.svg(
        "MiD of each method by date, with the best until then; the table below says the same.",
        [*parts, *_trace(frame, points, xs, ys)],
    )


def _month_ticks(low_s: float, high_s: float) -> list[tuple[float, str]]:
    """Firsts of months, few enough to be read, around these times."""
    first, last = (datetime.fromtimestamp(at_s, UTC) for at_s in (low_s, high_s))
    n_months = 12 * (last.year - first.year) + last.month - first.month + 1
    step = next(step for step in (1, 2, 3, 6, 12, 24, 60, 120, 1200) if n_months / step <= 6)
    index = (12 * first.year + first.month - 1) // step * step
    ticks = []
    while True:
        at = datetime(index // 12, index % 12 + 1, 1, tzinfo=UTC)
        ticks.append((at.timestamp(), f"{at:%Y}" if step >= 12 else f"{at:%Y-%m}"))
        if at.timestamp() >= high_s and len(ticks) > 1:
            return ticks
        index += step


# --- accuracy against latency ----------------------------------------------------------------------------


def latency(entries: Sequence[Entry]) -> Chart:
    """MiD against latency, of the methods that state one; the front is what nothing beats in both."""
    known = sorted(
        (
            (found, value, entry)
            for entry in entries
            if entry.is_visible_to_all
            and (found := entry.details.latency_ms) is not None
            and (value := entry.scores["mid"]) is not None
        ),
        key=lambda item: item[:2],
    )
    if not known:
        return Chart(kind="latency", panels=(), columns=(), points=())
    best, most = math.inf, max(entry.decimals for _, _, entry in known)
    points = []
    for found, value, entry in known:
        is_on_front, best = value < best, min(best, value)
        points.append(
            Point(
                (
                    entry.method,
                    _team(entry),
                    f"{found:g}",
                    entry.details.hardware or "not said",
                    _mid_cell(entry, value, most),
                    "yes" if is_on_front else "",
                ),
                x=found,
                y=value,
                decimals=entry.decimals,
                label=f"{entry.method}, {found:g} ms",
                is_marked=is_on_front,
            )
        )
    return Chart(
        kind="latency",
        panels=(
            (
                "Motion-in-depth error (MiD), ×10⁻⁴, against latency in ms, both logarithmic",
                _latency_panel(points),
            ),
        ),
        columns=("Method", "Team", "Latency in ms", "Hardware", "MiD ×10⁻⁴", "On the front"),
        points=tuple(points),
        numbers=(2, 4),
    )


def _latency_panel(points: Sequence[Point]) -> SafeString:
    xs = [math.log10(point.x or 1.0) for point in points]
    ys = [math.log10(point.y or 1.0) for point in points]
    decades = decade_ticks(min(xs), max(xs))
    frame, parts = log_ground(xs=(decades[0], decades[-1]), ys=ys)
    parts += [frame.column_label(x, f"{10**x:.3g}") for x in decades]
    return frame.svg(
        "MiD of each method against its latency, with the front; the table below says the same.",
        [*parts, *_trace(frame, points, xs, ys)],
    )


# --- what both draw --------------------------------------------------------------------------------------


def _trace(
    frame: Frame, points: Sequence[Point], xs: Sequence[float], ys: Sequence[float]
) -> Iterator[SafeString]:
    """A line that stays where it is until something better comes, and a mark for every point."""
    places = [(frame.x(x), frame.y(y)) for x, y in zip(xs, ys, strict=True)]
    line = [place for place, point in zip(places, points, strict=True) if point.is_marked]
    path = "M" + " ".join(line[0]) + "".join(f"H{x}V{y}" for x, y in line[1:])
    yield format_html('<path class="stairs" d="{}"/>', f"{path}H{frame.x(frame.xs[1])}")
    for (x, y), point in zip(places, points, strict=True):
        yield format_html(
            '<circle class="{}" cx="{}" cy="{}" r="4"><title>{}</title></circle>',
            "dot" if point.is_marked else "ring",
            x,
            y,
            f"{point.label}: {format_published(point.y, decimals=point.decimals)}",
        )
