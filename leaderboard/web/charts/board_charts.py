"""Charts of a board: progress over time, and accuracy against latency, of public rows and values alone."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Final

from django.utils.html import format_html
from django.utils.safestring import SafeString

from evaluator.metrics.registry import Metric
from evaluator.scoring.results import format_rounded
from leaderboard.boards.rows import Entry
from leaderboard.boards.snapshots import Attempt
from leaderboard.exports.tables import team_of
from leaderboard.web.charts.chart_options import (
    TEXT,
    Chart,
    Frame,
    Mark,
    Option,
    call,
    empty,
    error_axis,
    error_text,
    log_axis,
    method_href,
    x_axis,
)
from leaderboard.web.charts.chart_series import Look, marks, named_marks, staircase
from leaderboard.web.charts.range_leaders import listed

# Below the front, where its names are: this part of the whole height.
_ROOM: Final = 0.2
# Before the fastest, so that no mark lies on the axis.
_BESIDE: Final = 0.03
SUBMITTED, QUOTED = "Submissions", "Published results"
# Behind a front. More marks are a blot, and a board of ten thousand made a page of 7 MB of them.
MAX_BEHIND: Final = 500
# Fewer are no progress: a line straight up.
MIN_DATES: Final = 3
# Fewer have no front worth a drawing.
_MIN_LATENCIES: Final = 4
# So many methods without a latency are named.
_MAX_UNTIMED: Final = 6
# Up to so many points have room for a name each.
_FEW_POINTS: Final = 5
_OF_YEARS: Final = "Rows quoted from papers are placed in the middle of their year."
_OF_LATENCY: Final = "Latency is self-reported on different hardware."
_QUOTED_LATENCY: Final = "Latency is as printed in the papers, on different hardware."


# --- a front and what lies behind it ---------------------------------------------------------------------


@dataclass(frozen=True)
class _Placed:
    x: float
    y: float
    entry: Entry
    x_text: str
    is_front: bool = False

    def mark(self, praise: str, metric: Metric) -> Mark:
        value = error_text(metric, self.y, decimals=self.entry.decimals)
        read = [
            self.entry.method,
            team_of(self.entry),
            f"{value} {metric.unit}".rstrip() + f", {self.x_text}",
        ]
        return Mark(
            self.x, self.y, (*read, praise) if self.is_front else tuple(read), method_href(self.entry)
        )


def _with_front(placed: Iterable[tuple[float, float, Entry, str]]) -> list[_Placed]:
    """Sort points by x, then y; the front is better than everything before it."""
    best, points = math.inf, []
    for x, y, entry, x_text in sorted(placed, key=lambda each: each[:2]):
        points.append(_Placed(x, y, entry, x_text, is_front=y < best))
        best = min(best, y)
    return points


def _drawn(points: Sequence[_Placed], metric: Metric) -> tuple[list[_Placed], str]:
    """Return the front, the best points behind it, and a sentence on those left out."""
    behind = sorted((each for each in points if not each.is_front), key=lambda each: each.y)
    if len(behind) <= MAX_BEHIND:
        return list(points), ""
    left_out = set(map(id, behind[MAX_BEHIND:]))
    drawn = [each for each in points if id(each) not in left_out]
    lowest = f"the {len(drawn):,} with the lowest {metric.symbol}"
    return drawn, f"Shown are {lowest}, or on the line, of {len(points):,}."


def _front_series(
    points: Sequence[_Placed], metric: Metric, *, line: str, praise: str, end: float
) -> tuple[list[Option], list[str], dict[str, str]]:
    """Return the series of submissions and of published results, the legend's names, and its own keys."""
    front = [each for each in points if each.is_front]
    series = [staircase(line, [*((each.x, each.y) for each in front), (end, front[-1].y)])]
    names = [line]
    # A front of one point is a line only if it goes on to the end; the legend shows its mark.
    is_line = len(front) > 1 or end > front[-1].x
    keys = {} if is_line else {line: "circle" if front[0].entry.kind == "submission" else "diamond"}
    for kind, name, symbol in (("submission", SUBMITTED, "circle"), ("published", QUOTED, "diamond")):
        of_kind = [each for each in points if each.entry.kind == kind]
        if not of_kind:
            continue
        names.append(name)
        behind = [each.mark("", metric) for each in of_kind if not each.is_front]
        # A few are so large that one with the same place as a mark of the front is seen around it.
        is_few = len(points) <= _FEW_POINTS
        drawn_behind = marks(name, behind, Look("--quiet", symbol, 17.0 if is_few else 9.0, is_hollow=True))
        if is_few:
            drawn_behind["label"] = {**TEXT, "show": True, "position": "top", "formatter": call("name")}
        series.append(drawn_behind)
        ahead = [i for i, each in enumerate(front) if each.entry.kind == kind]
        drawn = [each.mark(praise, metric) for each in front]
        series.append(named_marks(name, drawn, ahead, Look("--s1", symbol, 11.0)))
    return series, names, keys


def _value_cells(points: Sequence[_Placed]) -> list[SafeString]:
    most = max(each.entry.decimals for each in points)
    return [
        format_html(
            '<span class="{}">{}</span>',
            decimals_css(each.entry, most).strip(),
            format_rounded(each.y, decimals=each.entry.decimals),
        )
        for each in points
    ]


def decimals_css(entry: Entry, most: int) -> str:
    """Return the class of a number with fewer decimals than `most`: it keeps the points aligned."""
    return "" if entry.decimals == most else f" d{entry.decimals}"


# --- progress over time ----------------------------------------------------------------------------------


_Dated = list[tuple[float, float, Entry, str]]


def _dated(entries: Iterable[Entry], attempts: Iterable[Attempt]) -> tuple[_Dated, list[int], list[datetime]]:
    """Return the points of a progress, the years of its papers, and the days of its submissions."""
    rows = list(entries)
    by_method = {entry.method_id: entry for entry in rows if entry.method_id is not None}
    quoted = [
        (entry, value, entry.year)
        for entry in rows
        if entry.kind == "published" and entry.year and (value := entry.value) is not None
    ]
    sent = [
        (by_method[attempt.method_id], value, _day(attempt.at))
        for attempt in attempts
        if attempt.method_id in by_method and (value := attempt.value) is not None
    ]
    placed = [
        (_ms(datetime(year, 7, 1, tzinfo=UTC)), value, entry, str(year)) for entry, value, year in quoted
    ]
    placed += [(_ms(day), value, entry, f"{day:%Y-%m-%d}") for entry, value, day in sent]
    return placed, [year for *_, year in quoted], [day for *_, day in sent]


def has_progress(entries: Iterable[Entry], attempts: Iterable[Attempt]) -> bool:
    """Tell whether there are results of enough dates to draw a progress."""
    placed, *_ = _dated(entries, attempts)
    return _n_dates(placed) >= MIN_DATES


def _n_dates(placed: _Dated) -> int:
    return len({x for x, *_ in placed})


def progress(
    entries: Iterable[Entry], attempts: Iterable[Attempt] = (), *, metric: Metric, now: datetime
) -> Chart:
    """Draw the ranking score of every submission by day, and published results by year, until today.

    Empty with results of fewer than three dates.
    """
    placed, years, days = _dated(entries, attempts)
    if _n_dates(placed) < MIN_DATES:
        return empty("progress")
    points, note = _drawn(_with_front(placed), metric)
    today = _day(now)
    first, last = _time_range([*days, today], years)
    series, names, keys = _front_series(
        points, metric, line="Best so far", praise="the best when it came", end=max(_ms(today), points[-1].x)
    )
    frame = Frame(
        x_axes=[x_axis(_time_title(first, last), _time_axis(first, last))],
        y_axes=[error_axis(metric, [each.y for each in points], room=_ROOM)],
        series=series,
        names=names,
        keys=keys,
        more=ZOOMABLE,
    )
    return Chart(
        kind="progress",
        label=f"{progress_label(metric)[:-1]}: {_front_words(points, metric)}.",
        options=frame.options(),
        columns=("Date", "Method", "Team", metric.heading, "Best so far"),
        rows=tuple(
            (each.x_text, each.entry.method, team_of(each.entry), value, "yes" if each.is_front else "")
            for each, value in zip(points, _value_cells(points), strict=True)
        ),
        numbers=(3,),
        is_zoomable=True,
        note=f"{note} {_OF_YEARS if years else ''}".strip(),
    )


def progress_label(metric: Metric) -> str:
    """What the chart shows, for those who cannot see it."""
    return f"{metric.symbol} of each method by date, with the lowest {metric.symbol} so far."


# Dragging over a chart looks closer at a stretch of its level axis; the script turns it on.
ZOOMABLE: Final = {
    "toolbox": {
        "itemSize": 0,
        "showTitle": False,
        "feature": {
            "dataZoom": {
                "yAxisIndex": "none",
                "filterMode": "none",
                "brushStyle": {"color": "--s1", "opacity": 0.15},
            }
        },
    }
}


def _front_words(points: Sequence[_Placed], metric: Metric) -> str:
    front = [each for each in points if each.is_front]
    texts = [
        f"{each.entry.method} {error_text(metric, each.y, decimals=each.entry.decimals)}" for each in front
    ]
    return texts[0] if len(texts) == 1 else f"from {texts[0]} to {texts[-1]}"


def _ms(at: datetime) -> float:
    return at.timestamp() * 1000


def _day(at: datetime) -> datetime:
    return at.astimezone(UTC).replace(hour=0, minute=0, second=0, microsecond=0)


def _time_range(days: Sequence[datetime], years: Sequence[int]) -> tuple[datetime, datetime]:
    """Return the ends of the time axis: whole years around papers, a margin around submissions."""
    ends = [datetime(year, 1, 1, tzinfo=UTC) for year in years]
    ends += [datetime(year + 1, 1, 1, tzinfo=UTC) for year in years]
    margin = max(0.04 * (max([*ends, *days]) - min([*ends, *days])), timedelta(days=1))
    ends += [day - margin for day in days] + [day + margin for day in days]
    return min(ends), max(ends)


def _time_axis(first: datetime, last: datetime) -> Option:
    label = {
        "formatter": {"year": "{yyyy}", "month": "{MMM} {yyyy}", "day": "{d} {MMM}"},
        "showMinLabel": first.month == first.day == 1,
        "showMaxLabel": False,
    }
    return {"type": "time", "min": _ms(first), "max": _ms(last), "axisLabel": label, "splitNumber": 5}


def _time_title(first: datetime, last: datetime) -> str:
    if last - first > timedelta(days=60):
        return "Date"
    years = sorted({f"{first:%Y}", f"{last:%Y}"})
    return f"Date in {' and '.join(years)} (UTC)"


# --- accuracy against latency ----------------------------------------------------------------------------


def latency(entries: Sequence[Entry], *, metric: Metric) -> Chart:
    """Draw the metric that ranks against latency, with the Pareto front; empty with few latencies."""
    ranked = [entry for entry in entries if entry.is_visible_to_all and entry.value is not None]
    points, note = _drawn(
        _with_front(
            (
                latency_ms,
                value,
                entry,
                f"{latency_ms:g} ms on {entry.details['hardware'] or 'unknown hardware'}",
            )
            for entry in ranked
            if (latency_ms := entry.details["latency_ms"]) is not None and (value := entry.value) is not None
        ),
        metric,
    )
    if len(points) < _MIN_LATENCIES:
        return empty("latency")
    last = max(each.x for each in points if each.is_front)
    series, names, keys = _front_series(
        points, metric, line="Pareto front", praise="on the Pareto front", end=last
    )
    untimed = [entry.method for entry in ranked if entry.details["latency_ms"] is None]
    missing = f"No latency is given for {listed(untimed, n_named=_MAX_UNTIMED)}." if untimed else ""
    source = _OF_LATENCY if any(each.entry.kind == "submission" for each in points) else _QUOTED_LATENCY
    frame = Frame(
        x_axes=[x_axis("Latency in ms (log scale)", log_axis((each.x for each in points), room=_BESIDE))],
        y_axes=[error_axis(metric, [each.y for each in points], room=_ROOM)],
        series=series,
        names=names,
        keys=keys,
    )
    return Chart(
        kind="latency",
        label=f"{metric.symbol} of each method against its latency, with the Pareto front: "
        f"{_front_words(points, metric)}.",
        options=frame.options(),
        columns=("Method", "Team", "Latency in ms", "Hardware", metric.heading, "On the Pareto front"),
        rows=tuple(
            (
                each.entry.method,
                team_of(each.entry),
                f"{each.x:g}",
                each.entry.details["hardware"] or "not specified",
                value,
                "yes" if each.is_front else "",
            )
            for each, value in zip(points, _value_cells(points), strict=True)
        ),
        numbers=(2, 4),
        note=" ".join(each for each in (source, missing, note) if each),
    )
