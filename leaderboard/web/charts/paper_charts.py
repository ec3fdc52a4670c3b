"""The page of the paper's tables, each in other formats, and charts of the ablations."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from typing import Final, NamedTuple

from django.conf import settings
from django.http import Http404, HttpRequest, HttpResponse
from django.shortcuts import render
from django.views.decorators.gzip import gzip_page
from django.views.decorators.http import require_safe

from evaluator.metrics.protocol import OVERALL, SCORE_NAMES, TTC_RANGES, metric_of, split_name
from evaluator.metrics.registry import Metric
from evaluator.papers.tables import PublishedRow, PublishedTable, published_tables
from evaluator.tables import published
from evaluator.tables.formats import FORMATS
from evaluator.tables.published import PrintedRow, PrintedTable, method_name, setting_text
from leaderboard.web.charts.chart_options import (
    Chart,
    Frame,
    Mark,
    Option,
    empty,
    error_axis,
    ticks_axis,
    x_axis,
)
from leaderboard.web.charts.chart_series import SERIES_INKS, SERIES_SYMBOLS, Look, line, marks

_MIN_SETTINGS: Final = 3
"""Two settings are read faster in the table."""
MAX_TOGETHER: Final = 24
"""So many letters of a cell stay on one line."""
_HOLLOW: Final = "Hollow: the paper’s default."
_NEAR: Final = "Axes do not start at 0."
"""Of straight axes: a logarithmic one has no 0."""


def sweep(shown: PrintedTable) -> Chart:
    """Draw MiD and RTE over the setting that a table varies; empty without one."""
    table = shown.table
    rows: dict[str | None, list[PublishedRow]] = defaultdict(list)
    for row in table.rows:
        if isinstance(row.setting, int | float) and not isinstance(row.setting, bool):
            rows[row.method].append(row)
    if not table.is_result or min(map(len, rows.values()), default=0) < _MIN_SETTINGS:
        return empty("published")
    scores = [name for name in table.columns if name in SCORE_NAMES]
    metrics = list(dict.fromkeys(map(metric_of, scores)))
    # Lines of one panel differ by the method, or by the TTC range where there is one method.
    has_ranges = any(split_name(name)[1] != OVERALL for name in scores)
    lines = [
        (split_name(name)[1] if has_ranges else method_name(of_method[0]), name, of_method)
        for of_method in rows.values()
        for name in scores
    ]
    names = list(dict.fromkeys(legend for legend, *_ in lines))
    settings = sorted({_setting(row) for of_method in rows.values() for row in of_method})
    room = 0.04 * (settings[-1] - settings[0])
    setting_axis = ticks_axis(
        [(setting, f"{setting:,g}") for setting in settings], low=settings[0] - room, high=settings[-1] + room
    )
    frame = Frame(
        x_axes=[x_axis(shown.headings[shown.n_names - 1], setting_axis) for _ in metrics],
        y_axes=[error_axis(metric, _values(table, metric), is_near=True) for metric in metrics],
        series=[
            series
            for legend, name, of_method in lines
            for series in _series(
                legend,
                name,
                [(_setting(row), float(row.values[table.columns.index(name)]), row) for row in of_method],
                index=names.index(legend) % len(SERIES_INKS),
                grid=metrics.index(metric_of(name)),
            )
        ],
        names=names,
        keys=dict(zip(names, SERIES_SYMBOLS, strict=False)),
    )
    symbols = " and ".join(metric.symbol for metric in metrics)
    return Chart(
        kind=table.name,
        label=f"{symbols} for {len(settings)} settings: {shown.title}. The table has the same numbers.",
        options=frame.options(),
        columns=shown.headings,
        rows=tuple(row.cells for row in shown.rows),
        note=_HOLLOW if any(axis["type"] == "log" for axis in frame.y_axes) else f"{_HOLLOW} {_NEAR}",
    )


def _setting(row: PublishedRow) -> float:
    return float(row.setting or 0)


def _series(
    legend: str, name: str, points: Sequence[tuple[float, float, PublishedRow]], *, index: int, grid: int
) -> list[Option]:
    metric, ttc_range = metric_of(name), split_name(name)[1]
    named = metric.symbol if ttc_range == OVERALL else f"{metric.symbol} {ttc_range}"
    setting_marks = [
        Mark(
            x,
            y,
            (f"{legend}, {setting_text(row)}", f"{named} {y:.1f}")
            + (("the paper's default",) if row.is_default else ()),
        )
        for x, y, row in points
    ]
    look = Look(SERIES_INKS[index], SERIES_SYMBOLS[index])
    drawn = marks(legend, setting_marks, look, grid=grid)
    for item, (*_, row) in zip(drawn["data"], points, strict=True):
        if row.is_default:
            item["itemStyle"] = replace(look, is_hollow=True).style() | {"borderWidth": 1.75}
    return [line(legend, [(x, y) for x, y, _ in points], SERIES_INKS[index], grid=grid), drawn]


def _values(table: PublishedTable, metric: Metric) -> list[float]:
    columns = [i for i, name in enumerate(table.columns) if name in SCORE_NAMES and metric_of(name) == metric]
    return [float(row.values[i]) for row in table.rows for i in columns]


# A table has no papers of its own to cite, and its document is the API's.
DOWNLOADS: Final = tuple(each for each in FORMATS if each.name in {"csv", "latex", "markdown"})


_WHY: Final = " Why: "
"""In a note, between what is so and its derivation, which the page folds."""


def _groups(tables: Sequence[PrintedTable]) -> dict[str, list[tuple[PrintedTable, Chart]]]:
    """Group the tables for the index: what was measured, what was varied, and what the data is.

    Those with a chart come first: two stand side by side, and one without a chart would leave a hole.
    """
    groups: dict[str, list[tuple[PrintedTable, Chart]]] = {"Results": [], "Ablations": [], "Dataset": []}
    for each, chart in sorted(((each, sweep(each)) for each in tables), key=lambda pair: not pair[1]):
        kind = "Ablations" if each.table.parameter else "Results"
        groups[kind if each.table.is_result else "Dataset"].append((each, chart))
    return groups


def _with_best(shown: PrintedTable) -> list[tuple[PrintedRow, frozenset[int]]]:
    """Return the rows, each with the places of the values that are lowest in their split, of main results."""
    if not shown.table.is_result or shown.table.parameter:
        return [(row, frozenset()) for row in shown.rows]
    lowest: dict[tuple[str, int], float] = {}
    for row in shown.rows:
        for i, text in enumerate(row.cells[shown.n_names :], start=shown.n_names):
            lowest[row.cells[0], i] = min(float(text), lowest.get((row.cells[0], i), float("inf")))
    return [
        (
            row,
            frozenset(
                i
                for (split, i), low in lowest.items()
                if split == row.cells[0] and float(row.cells[i]) == low
            ),
        )
        for row in shown.rows
    ]


class PaperCell(NamedTuple):
    """A text of a table with its heading; `is_default` marks the setting that the paper chose."""

    heading: str
    text: str
    css: str
    is_best: bool
    is_default: bool

    @property
    def is_long(self) -> bool:
        return len(self.text) > MAX_TOGETHER


def _row_groups(shown: PrintedTable) -> list[list[tuple[bool, list[PaperCell]]]]:
    """Return the rows, each with whether it is the default, those of one split together."""
    groups: dict[str, list[tuple[bool, list[PaperCell]]]] = {}
    for row, best in _with_best(shown):
        cells = [
            PaperCell(
                heading=heading,
                text=text,
                css=_css_of(shown, i) or ("wraps" if len(text) > MAX_TOGETHER else ""),
                is_best=i in best,
                is_default=row.is_default and i == shown.n_names - 1,
            )
            for i, (heading, text) in enumerate(zip(shown.headings, row.cells, strict=True))
        ]
        split = row.cells[0] if shown.headings[0] == "Split" else ""
        groups.setdefault(split, []).append((row.is_default, cells))
    return list(groups.values())


def _css_of(shown: PrintedTable, column: int) -> str:
    return "number" if shown.table.is_result and column >= shown.n_names else ""


def _about(shown: PrintedTable) -> str:
    return " ".join(f"{part}." for part in (shown.section, shown.subject, shown.units) if part)


@gzip_page
@require_safe
def published_page(request: HttpRequest) -> HttpResponse:
    if not settings.BENCHMARK.has_paper_tables:
        raise Http404("This benchmark has no tables of a paper.")
    groups = _groups(published.printed_tables())
    context = {
        "description": f"All tables of the {settings.BENCHMARK.name} paper as numbers: "
        "main results, ablations, cameras and scripts, as CSV and LaTeX.",
        "tables": [
            {
                "shown": each,
                "chart": chart,
                "about": _about(each),
                "has_best": each.table.is_result and not each.table.parameter,
                "headings": [(heading, _css_of(each, i)) for i, heading in enumerate(each.headings)],
                "row_groups": _row_groups(each),
                "notes": [note.partition(_WHY)[::2] for note in each.table.notes],
            }
            for each, chart in chain.from_iterable(groups.values())
        ],
        "groups": groups,
        "ranges": ", ".join(f"{each.name} {each.seconds}" for each in TTC_RANGES),
        "source": published_tables().source,
        "downloads": DOWNLOADS,
    }
    return render(request, "charts/published.html", context)


@require_safe
def published_table(request: HttpRequest, table_name: str, suffix: str) -> HttpResponse:
    chosen = next((each for each in DOWNLOADS if each.suffix == suffix), None)
    tables = published_tables().tables if settings.BENCHMARK.has_paper_tables else ()
    table = next((each for each in tables if each.name == table_name), None)
    if chosen is None or table is None:
        raise Http404(f"There is no table {table_name}.{suffix}.")
    return HttpResponse(
        published.WRITERS[chosen.name](published.printed(table)),
        content_type=f"{chosen.media_type}; charset=utf-8",
        headers={"Content-Disposition": f'attachment; filename="tsttc-paper-{table_name}.{suffix}"'},
    )
