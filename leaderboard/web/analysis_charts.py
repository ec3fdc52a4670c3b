"""The closer look at one submission, as it is drawn; only its team sees it, and only on open splits."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from django.utils.html import format_html
from django.utils.safestring import SafeString

from evaluator.report import format_published
from leaderboard.analyses import Closer
from leaderboard.templatetags.board import grouped
from leaderboard.web.chart_frames import Frame, log_ground
from leaderboard.web.charts import Chart, Point
from leaderboard.web.drawing import round_ticks, tick_text
from leaderboard.web.tables import METRIC_SYMBOLS, METRIC_UNITS

_TTC_TICKS_S: Final = (-20.0, -10.0, 0.0, 10.0, 20.0)


@dataclass(frozen=True)
class CloserTables:
    """Everything that the page of an analysis places."""

    n_sequences: str
    n_recordings: str
    curve: Chart
    histogram: Chart
    quantiles: tuple[tuple[str, str, str], ...]  # share, MiD, RTE
    scatter: Chart
    worst: tuple[tuple[str, str, str, str], ...]  # recording, sequences, MiD, RTE


def closer_tables(closer: Closer) -> CloserTables:
    """An analysis, ready to be placed."""
    content = closer.content
    return CloserTables(
        n_sequences=grouped(content["n_sequences"]),
        n_recordings=grouped(content["n_recordings"]),
        curve=_curve(content["curve"]),
        histogram=_histogram(content["histogram"]),
        quantiles=tuple(
            (f"{100 * mid['quantile']:.0f} %", format_published(mid["value"]), format_published(rte["value"]))
            for mid, rte in zip(content["distribution"]["mid"], content["distribution"]["rte"], strict=True)
        ),
        scatter=_scatter(content["scatter"]),
        worst=tuple(
            (row["recording"], grouped(row["n"]), format_published(row["mid"]), format_published(row["rte"]))
            for row in content["worst"]
        ),
    )


def _seconds(low_s: float, high_s: float) -> str:
    return f"{tick_text(low_s)} to {tick_text(high_s)}"


# --- error by time to contact ----------------------------------------------------------------------------


def _curve(bins: Sequence[Mapping[str, Any]]) -> Chart:
    points = tuple(
        Point(
            (
                _seconds(row["low_s"], row["high_s"]),
                grouped(row["n"]),
                format_published(row["mid"]),
                format_published(row["rte"]),
            )
        )
        for row in bins
    )
    panels = tuple(
        (f"{symbol}, {METRIC_UNITS[metric]}, logarithmic, by true time to contact in s", _steps(bins, metric))
        for metric, symbol in METRIC_SYMBOLS.items()
        if bins
    )
    columns = ("Time to contact in s", "Sequences", "MiD ×10⁻⁴", "RTE %")
    return Chart("curve", panels, columns, points, numbers=(1, 2, 3))


def _steps(bins: Sequence[Mapping[str, Any]], metric: str) -> SafeString:
    """The mean error of each bin as a flat line as wide as the bin."""
    least = min((row[metric] for row in bins if row[metric] > 0), default=1.0)
    heights = [math.log10(max(row[metric], least)) for row in bins]
    frame, parts = log_ground(xs=(_TTC_TICKS_S[0], _TTC_TICKS_S[-1]), ys=heights, width=360.0, height=230.0)
    parts += [frame.column_label(tick, tick_text(tick)) for tick in _TTC_TICKS_S]
    path = "".join(
        f"M{frame.x(row['low_s'])} {frame.y(height)}H{frame.x(row['high_s'])}"
        for row, height in zip(bins, heights, strict=True)
    )
    parts.append(format_html('<path class="stairs" d="{}"/>', path))
    return frame.svg(
        f"{METRIC_SYMBOLS[metric]} by true time to contact; the table below says the same.", parts
    )


# --- how errors are distributed --------------------------------------------------------------------------


def _histogram(bins: Sequence[Mapping[str, Any]]) -> Chart:
    points = tuple(
        Point(
            (
                f"{format_published(row['low'])} to {format_published(row['high'])}"
                if row["high"] is not None
                else f"{format_published(row['low'])} and more",
                grouped(row["n"]),
            )
        )
        for row in bins
    )
    panels = (
        (("Sequences by MiD, ×10⁻⁴; the last bar holds all that lies beyond", _bars(bins)),) if bins else ()
    )
    return Chart("histogram", panels, ("MiD ×10⁻⁴", "Sequences"), points, numbers=(1,))


def _bars(bins: Sequence[Mapping[str, Any]]) -> SafeString:
    ticks = round_ticks(0.0, float(max(row["n"] for row in bins)), n=4)
    frame = Frame(360, 210, xs=(0.0, float(len(bins))), ys=(0.0, ticks[-1]))
    parts = frame.rows(ticks)
    foot = frame.y(0.0)
    bars = "".join(
        f"M{frame.x(i + 0.08)} {foot}V{frame.y(row['n'])}H{frame.x(i + 0.92)}V{foot}z"
        for i, row in enumerate(bins)
    )
    parts.append(format_html('<path class="bars" d="{}"/>', bars))
    parts += [frame.column_label(at, tick_text(tick)) for at, tick in _bar_ticks(bins)]
    return frame.svg("How many sequences have which MiD; the table below says the same.", parts)


def _bar_ticks(bins: Sequence[Mapping[str, Any]]) -> list[tuple[float, float]]:
    """Round values of MiD, and where they stand among bars of equal width; none at the bar of the rest.

    >>> _bar_ticks([{"low": 0.0}, {"low": 4.0}, {"low": 8.0}, {"low": 12.0}])
    [(0.0, 0.0), (1.25, 5.0), (2.5, 10.0)]
    """
    end = bins[-1]["low"]
    if end <= 0:
        return [(0.0, 0.0)]
    ticks = round_ticks(0.0, end, n=4)
    return [((len(bins) - 1) * tick / end, tick) for tick in ticks if tick <= end]


# --- predicted against true ------------------------------------------------------------------------------


def _scatter(drawn: Mapping[str, Sequence[float]]) -> Chart:
    pairs = sorted(zip(drawn["true_s"], drawn["predicted_s"], strict=True))
    points = tuple(Point((f"{true_s:.3f}", f"{predicted_s:.3f}")) for true_s, predicted_s in pairs)
    panels = (
        (("Predicted (upwards) against true time to contact (to the right), in s", _cloud(pairs)),)
        if pairs
        else ()
    )
    return Chart("scatter", panels, ("True in s", "Predicted in s"), points, numbers=(0, 1))


def _cloud(pairs: Sequence[tuple[float, float]]) -> SafeString:
    """Every pair as a small mark over the line on which the two agree; what lies outside is at the rim."""
    low, high = _TTC_TICKS_S[0], _TTC_TICKS_S[-1]
    frame = Frame(360, 360, xs=(low, high), ys=(low, high))
    parts = frame.rows(_TTC_TICKS_S)
    parts += [frame.column_label(tick, tick_text(tick)) for tick in _TTC_TICKS_S]
    line = f"M{frame.x(low)} {frame.y(low)}L{frame.x(high)} {frame.y(high)}"
    parts.append(format_html('<path class="agree" d="{}"/>', line))
    marks = "".join(
        f"M{frame.x(min(max(true_s, low), high))} {frame.y(min(max(predicted_s, low), high))}h0"
        for true_s, predicted_s in pairs
    )
    parts.append(format_html('<path class="cloud" d="{}"/>', marks))
    return frame.svg("Predicted against true time to contact; the table below says the same.", parts)
