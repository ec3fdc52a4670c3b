"""The page of the paper's tables, each table in other formats, and charts of the ablations.

A chart has the errors over the setting that is varied, one line for each method.
"""

from collections import Counter
from typing import Final

from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import render
from django.views.decorators.gzip import gzip_page
from django.views.decorators.http import require_safe

from evaluator.metrics.metrics import Metric
from evaluator.metrics.protocol import OVERALL, SCORE_NAMES, metric_of, split_name
from evaluator.papers.tables import PublishedRow, published_tables
from evaluator.tables import published
from evaluator.tables.formats import FORMATS
from evaluator.tables.published import PrintedTable, method_name, setting_text
from leaderboard.web.boards.chart_options import (
    Chart,
    Frame,
    Mark,
    Option,
    empty,
    error_axis,
    places_axis,
    x_axis,
)
from leaderboard.web.boards.chart_series import SERIES_INKS, SERIES_SYMBOLS, Look, line, marks

_MIN_SETTINGS: Final = 3
"""Two settings are read faster in the table."""


def sweep(shown: PrintedTable) -> Chart:
    """MiD and RTE of a table over the setting that it varies; empty for a table that varies none."""
    table = shown.table
    per_method = Counter(row.method for row in table.rows if _is_number(row))
    if not table.is_result or min(per_method.values(), default=0) < _MIN_SETTINGS:
        return empty("published")
    settings = sorted({float(row.setting or 0) for row in table.rows})
    lines = _lines(shown)
    metrics = dict.fromkeys(metric_of(name) for _, name in lines)
    low, high = settings[0], settings[-1]
    room = 0.04 * (high - low)
    places = [(setting, f"{setting:,g}") for setting in settings]
    heading = shown.headings[shown.n_names - 1]
    series = [
        each
        for number, (method, name) in enumerate(lines)
        for each in _series(shown, number, method, name, grid=list(metrics).index(metric_of(name)))
    ]
    frame = Frame(
        x_axes=[x_axis(heading, places_axis(places, low=low - room, high=high + room)) for _ in metrics],
        y_axes=[error_axis(metric, _values(shown, metric)) for metric in metrics],
        series=series,
        names=list(dict.fromkeys(_legend(shown, *each) for each in lines)),
    )
    symbols = " and ".join(metric.symbol for metric in metrics)
    return Chart(
        kind=table.name,
        label=f"{symbols} for {len(settings)} settings: {shown.title}. The table has the same numbers.",
        options=frame.options(),
        columns=shown.headings,
        rows=tuple(row.cells for row in shown.rows),
    )


def _is_number(row: PublishedRow) -> bool:
    return isinstance(row.setting, int | float) and not isinstance(row.setting, bool)


def _lines(shown: PrintedTable) -> list[tuple[str, str]]:
    """Method and score of each line. One method with its TTC ranges has a line for each range."""
    methods = dict.fromkeys(row.method or "" for row in shown.table.rows)
    scores = [name for name in shown.table.columns if name in SCORE_NAMES]
    return [(method, name) for method in methods for name in scores]


def _legend(shown: PrintedTable, method: str, name: str) -> str:
    """What tells lines of one panel apart: the method, or the TTC range where there is one method."""
    row = next(row for row in shown.table.rows if (row.method or "") == method)
    interval = split_name(name)[1]
    has_ranges = any(split_name(each)[1] != OVERALL for each in shown.table.columns if each in SCORE_NAMES)
    return interval if has_ranges else method_name(row)


def _series(shown: PrintedTable, number: int, method: str, name: str, *, grid: int) -> list[Option]:
    """A line and its marks; the mark of the default is larger."""
    legend = _legend(shown, method, name)
    names = list(dict.fromkeys(_legend(shown, *each) for each in _lines(shown)))
    place = names.index(legend) % len(SERIES_INKS)
    column = shown.table.columns.index(name)
    rows = [row for row in shown.table.rows if (row.method or "") == method and _is_number(row)]
    points = [(float(row.setting or 0), float(row.values[column])) for row in rows]
    ink, symbol = SERIES_INKS[place], SERIES_SYMBOLS[place]
    found = [
        Mark(x, y, (f"{legend}, {setting_text(row)}", f"{_named(name)} {y:.1f}", *_default(row)))
        for (x, y), row in zip(points, rows, strict=True)
    ]
    drawn = marks(legend, found, Look(ink, symbol, 8.0), grid=grid)
    for item, row in zip(drawn["data"], rows, strict=True):
        if row.is_default:
            item["symbolSize"] = 13.0
    return [line(legend, points, ink, grid=grid), drawn]


def _default(row: PublishedRow) -> tuple[str, ...]:
    return ("the paper's default",) if row.is_default else ()


def _named(name: str) -> str:
    interval = split_name(name)[1]
    symbol = metric_of(name).symbol
    return symbol if interval == OVERALL else f"{symbol} {interval}"


def _values(shown: PrintedTable, metric: Metric) -> list[float]:
    columns = [
        place
        for place, name in enumerate(shown.table.columns)
        if name in SCORE_NAMES and metric_of(name) == metric
    ]
    return [float(row.values[place]) for row in shown.table.rows for place in columns]


# A table has no papers of its own to cite, and its document is the API's.
DOWNLOADS: Final = tuple(each for each in FORMATS if each.name in {"csv", "latex", "markdown"})


@gzip_page
@require_safe
def published_page(request: HttpRequest) -> HttpResponse:
    """All tables, each with its notes; a chart where a setting is varied."""
    shown = [{"shown": each, "chart": sweep(each)} for each in published.printed_tables()]
    context = {"tables": shown, "source": published_tables().source, "downloads": DOWNLOADS}
    return render(request, "boards/published.html", context)


@require_safe
def published_table(request: HttpRequest, table_name: str, suffix: str) -> HttpResponse:
    """One table as CSV, LaTeX or Markdown."""
    chosen = next((each for each in DOWNLOADS if each.suffix == suffix), None)
    table = next((each for each in published_tables().tables if each.name == table_name), None)
    if chosen is None or table is None:
        raise Http404(f"There is no table {table_name}.{suffix}.")
    return HttpResponse(
        published.WRITERS[chosen.name](published.printed(table)),
        content_type=f"{chosen.media_type}; charset=utf-8",
        headers={"Content-Disposition": f'attachment; filename="tsttc-paper-{table_name}.{suffix}"'},
    )
