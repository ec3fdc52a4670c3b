"""Charts of a submission's error analysis, for its team on open splits."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from evaluator.counting import counted
from evaluator.metrics.registry import WARNING, WARNING_S, Metric
from evaluator.scoring.results import format_rounded
from leaderboard.boards.rows import Entry
from leaderboard.models import Analysis
from leaderboard.web.charts.chart_options import (
    Chart,
    Frame,
    Mark,
    Option,
    call,
    empty,
    error_axis,
    ticks_axis,
    x_axis,
    y_axis,
)
from leaderboard.web.charts.chart_series import Look, band, bars, line, marks
from leaderboard.web.charts.svg import round_ticks, tick_text
from leaderboard.web.formatting import grouped

_END_S: Final = 20.0
_TTC_AXIS: Final = {
    "type": "value",
    "min": -_END_S,
    "max": _END_S,
    "interval": 10,
    "axisLabel": {"formatter": call("number")},
}
MEAN, SPAN = "Mean error", "95% confidence interval"
MISSED, FALSE = "Missed warnings", "False alarms"
SHARE: Final = "Share of sequences"
Row = Mapping[str, Any]
Reference = tuple[str, Entry, Sequence[Row]]
# Of the reference curves, and the same as a key: one of ECharts is too short to show dashes, and has a dot.
_DASHES: Final = ("solid", "dashed")
_KEYS: Final = ("path://M0 0H20V3H0Z", "path://M0 0H8V3H0ZM12 0H20V3H12Z")
_NEAR_S: Final = 6.0


def error_analysis_tables(closer: Analysis, references: Sequence[Reference]) -> dict[str, Any]:
    """Return the charts and tables of an analysis; `references` are rows of the board to compare with."""
    content, distribution = closer.content, closer.content["distribution"]
    rules = closer.evaluation.edition.rules
    errors = [metric for metric in rules.metrics if metric.name in distribution]
    # Quantiles of an error that is either 0 or 100 say nothing.
    graded = [metric for metric in errors if metric is not WARNING]
    quantiles = zip(*(distribution[metric.name] for metric in graded), strict=True)
    return {
        "n_sequences": counted(content["n_sequences"], "sequence"),
        "n_recordings": counted(content["n_recordings"], "recording"),
        "curve": curve(content["curve"], errors, references),
        "histogram": histogram(content["histogram"], rules.primary),
        "primary": rules.primary.symbol,
        "errors": errors,
        "graded": graded,
        "quantiles": [
            (f"{100 * row[0]['quantile']:.0f}%", [format_rounded(each["value"]) for each in row])
            for row in quantiles
        ],
        "scatter": scatter(content["scatter"]),
        "warnings": warnings(content.get("warnings", ())),
        "threshold": f"{WARNING_S:g} s",
        "at_threshold": [
            (
                name,
                _with_interval(row[side]["share"], row[side]["interval"], unit="%"),
                grouped(row[side]["n"]),
                condition,
            )
            for row in content.get("warnings", ())
            if row["threshold_s"] == WARNING_S
            for name, side, condition in _SIDES
        ],
        "worst": [
            (row["recording"], grouped(row["n"]), [format_rounded(row[metric.name]) for metric in errors])
            for row in content["worst"]
        ],
    }


# --- error by time to contact ----------------------------------------------------------------------------


def curve(bins: Sequence[Row], errors: Sequence[Metric], references: Sequence[Reference] = ()) -> Chart:
    """Draw mean errors by true TTC with confidence intervals, and those of other rows in grey."""
    if not bins:
        return empty("curve")
    has_intervals = any(_interval(row, metric) for row in bins for metric in errors)
    of_bin = [{(row["low_s"], row["high_s"]): row for row in others} for _, _, others in references]
    drawn = [row for rows in (*(others for _, _, others in references), bins) for row in rows]
    names = [f"{label}: {entry.method}" for label, entry, _ in references]
    axes = {metric: _axis_of(metric, drawn) for metric in errors}
    frame = Frame(
        x_axes=[x_axis("True time to contact in s", axes[metric]) for metric in errors],
        y_axes=[error_axis(metric, _ends(drawn, metric)) for metric in errors],
        series=[
            *(
                line(name, [(_middle(row), row[metric.name]) for row in run], "--quiet", grid=i, dash=dash)
                for name, dash, (_, _, others) in zip(names, _DASHES, references, strict=False)
                for i, metric in enumerate(errors)
                for run in _runs(others)
            ),
            *(
                series
                for i, metric in enumerate(errors)
                for run in _runs(bins)
                for series in _curve_series(run, metric, grid=i)
            ),
        ],
        names=[MEAN, *([SPAN] if has_intervals else []), *names],
        keys=dict(zip(names, _KEYS, strict=False)),
    )
    others_columns = [f"{metric.symbol} of {entry.method}" for _, entry, _ in references for metric in errors]
    columns = ("Time to contact in s", "Sequences", *(metric.heading for metric in errors), *others_columns)
    return Chart(
        kind="curve",
        label=f"Mean {' and '.join(metric.symbol for metric in errors)} by true time to contact.",
        options=frame.options(),
        columns=columns,
        rows=tuple(
            (
                _seconds(row),
                grouped(row["n"]),
                *(_value_words(row, metric) for metric in errors),
                *(
                    format_rounded(others[key][metric.name] if key in others else None)
                    for key in [(row["low_s"], row["high_s"])]
                    for others in of_bin
                    for metric in errors
                ),
            )
            for row in bins
        ),
        numbers=tuple(range(1, len(columns))),
        has_intervals=has_intervals,
        note=f"The warning error ({WARNING.symbol}), explained below, is shown for 0 to {_NEAR_S:g} s. "
        "Elsewhere it is at most 1%."
        if axes.get(WARNING, _TTC_AXIS) is not _TTC_AXIS
        else "",
    )


def _axis_of(metric: Metric, rows: Sequence[Row]) -> Option:
    """Return the axis of true times; near the threshold only, if warnings elsewhere are hardly ever wrong."""
    far = [row[metric.name] for row in rows if not 0 <= _middle(row) <= _NEAR_S]
    if metric is not WARNING or max(far, default=0.0) > 1:
        return _TTC_AXIS
    return {**_TTC_AXIS, "min": 0, "max": _NEAR_S, "interval": 1}


def _middle(row: Row) -> float:
    return float(row["low_s"] + row["high_s"]) / 2


def _interval(row: Row, metric: Metric) -> tuple[float, float] | None:
    interval = row.get("intervals", {}).get(metric.name)
    return (interval[0], interval[1]) if interval else None


def _ends(bins: Sequence[Row], metric: Metric) -> list[float]:
    return [value for row in bins for value in (row[metric.name], *(_interval(row, metric) or ()))]


def _runs(bins: Sequence[Row]) -> Iterator[list[Row]]:
    # No line crosses a gap without sequences.
    run = list(bins[:1])
    for before, row in itertools.pairwise(bins):
        if row["low_s"] != before["high_s"]:
            yield run
            run = []
        run.append(row)
    if run:
        yield run


def _curve_series(run: Sequence[Row], metric: Metric, *, grid: int) -> Iterator[Option]:
    middles = [_middle(row) for row in run]
    points = [
        Mark(
            middle,
            row[metric.name],
            (
                f"{_seconds(row)} s",
                f"{metric.symbol} {_value_words(row, metric)}",
                counted(row["n"], "sequence"),
            ),
        )
        for middle, row in zip(middles, run, strict=True)
    ]
    spans = [
        (middle, *interval)
        for middle, row in zip(middles, run, strict=True)
        if (interval := _interval(row, metric)) is not None
    ]
    yield band(SPAN, spans, "--s1", grid=grid)
    yield line(MEAN, [(mark.x, mark.y) for mark in points], "--s1", grid=grid)
    yield marks(MEAN, points, Look("--s1", size=5.0), grid=grid) | {"upright": True}


def _seconds(row: Row) -> str:
    return f"{tick_text(row['low_s'])} to {tick_text(row['high_s'])}"


def _value_words(row: Row, metric: Metric) -> str:
    return _with_interval(row[metric.name], _interval(row, metric))


def _with_interval(value: float | None, interval: Sequence[float] | None, *, unit: str = "") -> str:
    if interval is None:
        return f"{format_rounded(value)}{unit}"
    return f"{format_rounded(value)}{unit} ({format_rounded(interval[0])} to {format_rounded(interval[1])})"


# --- who is warned ---------------------------------------------------------------------------------------

_SIDES: Final = (
    (MISSED, "missed", f"0 < τ ≤ {WARNING_S:g} s"),
    (FALSE, "false", f"τ ≤ 0 or τ > {WARNING_S:g} s"),
)


def warnings(rows: Sequence[Row]) -> Chart:
    """Draw the shares of missed warnings and of false alarms by the threshold of a warning."""
    if not rows:
        return empty("warnings")
    sides = [side for _, side, _ in _SIDES]
    has_intervals = any(row[side]["interval"] for row in rows for side in sides)
    axis = {"type": "value", "min": rows[0]["threshold_s"], "max": rows[-1]["threshold_s"], "interval": 1}
    frame = Frame(
        x_axes=[x_axis("Threshold in s", axis) for _ in _SIDES],
        y_axes=[y_axis(f"{name}, %", {"type": "value", "min": 0}) for name, _, _ in _SIDES],
        series=[
            series
            for i, (name, side, _) in enumerate(_SIDES)
            for series in _side_series([row for row in rows if row[side]["n"]], name, side, grid=i)
        ],
        names=[SHARE, SPAN] if has_intervals else [],
    )
    columns = ("Threshold in s", *(text for name, _, _ in _SIDES for text in ("Sequences", f"{name} %")))
    return Chart(
        kind="warnings",
        label="Missed warnings and false alarms by the threshold of a warning.",
        options=frame.options(),
        columns=columns,
        rows=tuple(
            (tick_text(row["threshold_s"]), *(text for side in sides for text in _side_words(row[side])))
            for row in rows
        ),
        numbers=tuple(range(1, len(columns))),
        has_intervals=has_intervals,
    )


def _side_series(rows: Sequence[Row], name: str, side: str, *, grid: int) -> Iterator[Option]:
    points = [
        Mark(
            row["threshold_s"],
            row[side]["share"],
            (
                f"{tick_text(row['threshold_s'])} s",
                f"{name} {_side_words(row[side])[1]}%",
                f"of {counted(row[side]['n'], 'sequence')}",
            ),
        )
        for row in rows
    ]
    spans = [(row["threshold_s"], *row[side]["interval"]) for row in rows if row[side]["interval"]]
    yield band(SPAN, spans, "--s1", grid=grid)
    yield line(SHARE, [(mark.x, mark.y) for mark in points], "--s1", grid=grid)
    yield marks(SHARE, points, Look("--s1", size=5.0), grid=grid) | {"upright": True}


def _side_words(side: Row) -> tuple[str, str]:
    return grouped(side["n"]), _with_interval(side["share"], side["interval"])


# --- how errors are distributed --------------------------------------------------------------------------


def histogram(bins: Sequence[Row], metric: Metric) -> Chart:
    """Draw the number of sequences in each bin of a metric; the last bar holds all larger errors."""
    if not bins:
        return empty("histogram")
    words = [_bin_words(row) for row in bins]
    bar_marks = [
        Mark(i, row["n"], (f"{metric.symbol} {text}", counted(row["n"], "sequence")))
        for i, (row, text) in enumerate(zip(bins, words, strict=True))
    ]
    scale = ticks_axis(_bar_ticks(bins), low=0.0, high=float(len(bins)))
    bar_axis = {"type": "category", "data": list(range(len(bins))), "show": False}
    frame = Frame(
        x_axes=[bar_axis],
        y_axes=[y_axis("Sequences", {"type": "value", "min": 0, "minInterval": 1, "boundaryGap": [0, "5%"]})],
        series=[bars("Sequences", bar_marks, "--s1")],
        further_x_axes=[x_axis(f"{metric.title} ({metric.symbol}), {metric.unit}".rstrip(", "), scale)],
    )
    return Chart(
        kind="histogram",
        label=f"Number of sequences by {metric.symbol}; the last bar holds all larger values.",
        options=frame.options(),
        columns=(metric.heading, "Sequences"),
        rows=tuple((text, grouped(row["n"])) for text, row in zip(words, bins, strict=True)),
        numbers=(1,),
    )


def _bin_words(row: Row) -> str:
    low, high = format_rounded(row["low"]), row["high"]
    return f"{low} and more" if high is None else f"{low} to {format_rounded(high)}"


def _bar_ticks(bins: Sequence[Row]) -> list[tuple[float, str]]:
    """Return round values of the error at their positions among bars of equal width.

    >>> _bar_ticks([{"low": 0.0}, {"low": 4.0}, {"low": 8.0}, {"low": 12.0}])
    [(0.0, '0'), (1.25, '5'), (2.5, '10'), (3.5, 'more')]
    """
    end = bins[-1]["low"]
    rest = (len(bins) - 0.5, "more")
    if end <= 0:
        return [(0.0, "0"), rest]
    ticks = [tick for tick in round_ticks(0.0, end, n=4) if tick <= end]
    placed = [((len(bins) - 1) * tick / end, tick_text(tick)) for tick in ticks]
    # A narrow window has no room for two texts side by side.
    return [*((x, text) for x, text in placed if rest[0] - x > 0.1 * len(bins)), rest]


# --- predicted against true ------------------------------------------------------------------------------


def scatter(drawn: Mapping[str, Sequence[float]]) -> Chart:
    """Draw predicted against true TTC; outliers are at the edge."""
    pairs = sorted(zip(drawn["true_s"], drawn["predicted_s"], strict=True))
    if not pairs:
        return empty("scatter")
    points = [
        Mark(
            _clipped(true_s),
            _clipped(predicted_s),
            (f"true {true_s:.3f} s", f"predicted {predicted_s:.3f} s"),
        )
        for true_s, predicted_s in pairs
    ]
    cloud = marks("Sequences", points, Look("--s1", size=5.0))
    cloud["itemStyle"] = {"color": "--s1", "opacity": 0.6}
    frame = Frame(
        x_axes=[x_axis("True time to contact in s", _TTC_AXIS)],
        y_axes=[y_axis("Predicted, s", _TTC_AXIS)],
        series=[line("Perfect", [(-_END_S, -_END_S), (_END_S, _END_S)], "--rule"), cloud],
    )
    return Chart(
        kind="scatter",
        label="Predicted against true time to contact, with the line on which the two agree.",
        options=frame.options(),
        columns=("True in s", "Predicted in s"),
        rows=tuple((f"{true_s:.3f}", f"{predicted_s:.3f}") for true_s, predicted_s in pairs),
        numbers=(0, 1),
    )


def _clipped(seconds: float) -> float:
    return min(max(seconds, -_END_S), _END_S)
