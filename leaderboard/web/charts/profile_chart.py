"""The chart of errors by TTC range, with confidence intervals, of up to five methods."""

import itertools
from collections.abc import Sequence

from django.utils.html import format_html
from django.utils.safestring import SafeString

from evaluator.metrics.protocol import OVERALL, grouped_names, metric_of, range_of, split_name
from evaluator.scoring.results import format_rounded
from leaderboard.boards.rows import ConfidenceInterval, Entry
from leaderboard.web.charts.board_charts import decimals_css
from leaderboard.web.charts.chart_options import (
    Chart,
    Frame,
    Mark,
    Option,
    empty,
    error_axis,
    method_href,
    names_axis,
    x_axis,
)
from leaderboard.web.charts.chart_series import SERIES_INKS, SERIES_SYMBOLS, Look, marks, strips, whiskers
from leaderboard.web.formatting import figure_css, interval_words


def profile(entries: Sequence[Entry], *, n_metrics: int | None = None) -> Chart:
    """Draw errors by TTC range, one panel for each metric, or for the first `n_metrics`."""
    shown = [entry for entry in entries if entry.value is not None][: len(SERIES_INKS)]
    if not shown:
        return empty("profile")
    panels = dict(list(grouped_names(shown[0].scores).items())[:n_metrics])
    legend = distinct_names(shown)
    frame = Frame(
        x_axes=[x_axis("", names_axis([_range_words(name) for name in names])) for names in panels.values()],
        y_axes=[error_axis(metric, _all_ends(shown, names)) for metric, names in panels.items()],
        series=[
            *(
                strips(range(0, len(names), 2), max(_all_ends(shown, names), default=1.0), grid=i)
                for i, names in enumerate(panels.values())
            ),
            *(
                series
                for k, entry in enumerate(shown)
                for i, names in enumerate(panels.values())
                for series in _profile_series(k, entry, names, legend=legend, grid=i)
            ),
        ],
        names=legend if len(shown) > 1 else [],
    )
    # As if all had the most decimals: the others keep the room of the missing one.
    most = max(entry.decimals for entry in shown)
    css = figure_css(
        format_rounded(entry.scores[name], decimals=most) for entry in shown for name in entry.scores
    )
    names = ", ".join(entry.method for entry in shown)
    return Chart(
        kind="profile",
        label=f"{' and '.join(metric.symbol for metric in panels)} by TTC range of {names}.",
        options=frame.options(),
        columns=("Error", "TTC range", *legend),
        rows=tuple(
            (
                metric_of(name).symbol,
                split_name(name)[1],
                *(_profile_cell(entry, name, css, most) for entry in shown),
            )
            for name in itertools.chain(*panels.values())
        ),
        has_intervals=any(each.low is not None for entry in shown for each in entry.intervals.values()),
    )


def distinct_names(entries: Sequence[Entry]) -> list[str]:
    """Name methods differently, as a legend needs: a name that repeats gets its team, year or position."""
    methods = [entry.method for entry in entries]
    asides = ([entry.team for entry in entries], [entry.year for entry in entries])
    for aside in (*asides, range(1, len(entries) + 1)):
        names = [
            method if methods.count(method) == 1 else f"{method} ({words})"
            for method, words in zip(methods, aside, strict=True)
        ]
        if len(set(names)) == len(names):
            break
    return names


def _all_ends(shown: Sequence[Entry], names: Sequence[str]) -> list[float]:
    return [
        value
        for entry in shown
        for name in names
        for interval in [entry.intervals.get(name, ConfidenceInterval())]
        for value in (entry.scores[name], interval.low, interval.high)
        if value is not None
    ]


def _profile_series(
    k: int, entry: Entry, names: Sequence[str], *, legend: Sequence[str], grid: int
) -> tuple[Option, Option]:
    """Return the marks and whiskers of one method in one panel, moved aside from others."""
    step = min(0.16, 0.7 / len(legend))
    offset = step * (k - (len(legend) - 1) / 2)
    points = [
        (i + offset, value, name) for i, name in enumerate(names) if (value := entry.scores[name]) is not None
    ]
    profile_marks = [
        Mark(x, value, (entry.method, f"{_named(name)}: {_value_words(entry, name)}"), method_href(entry))
        for x, value, name in points
    ]
    spans = [
        (x, interval.low, interval.high)
        for x, _, name in points
        for interval in [entry.intervals.get(name, ConfidenceInterval())]
        if interval.low is not None and interval.high is not None
    ]
    name, look = legend[k], Look(SERIES_INKS[k], SERIES_SYMBOLS[k], 9.0)
    return marks(name, profile_marks, look, grid=grid), whiskers(name, spans, SERIES_INKS[k], grid=grid)


def _range_words(name: str) -> str:
    ttc_range = range_of(name)
    return f"{ttc_range.seconds}\n{ttc_range.name}" if ttc_range else OVERALL


def _named(name: str) -> str:
    return f"{metric_of(name).symbol} {split_name(name)[1]}"


def _value_words(entry: Entry, name: str) -> str:
    words = interval_words(entry.intervals.get(name, ConfidenceInterval()), decimals=entry.decimals)
    value = format_rounded(entry.scores[name], decimals=entry.decimals)
    return f"{value} ({words})" if words else value


def _profile_cell(entry: Entry, name: str, css: str, most: int) -> SafeString:
    words = interval_words(entry.intervals.get(name, ConfidenceInterval()), decimals=entry.decimals)
    return format_html(
        '<span class="{}{}">{}</span>{}',
        css,
        decimals_css(entry, most),
        format_rounded(entry.scores[name], decimals=entry.decimals),
        f" ({words})" if words else "",
    )
