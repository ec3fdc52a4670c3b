"""The tables of the paper as people read them: texts for pages and the command, and other formats."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Final

from evaluator.metrics.protocol import OVERALL, SCORE_NAMES, metric_of, split_name
from evaluator.papers.tables import PublishedRow, PublishedTable, PublishedTables, published_tables
from evaluator.tables.escaping import csv_line, latex, latex_comment, markdown

ABSENT: Final = "–"
TIME: Final = "time_ms"

_TITLES: Final = {
    "dataset-comparison": "Datasets",
    "main-results": "Main results",
    "camera-specification": "Cameras",
    "ablation-scale-bins-pixel-mse": "Scale bins of Pixel MSE",
    "ablation-scale-bins-deep-scale": "Scale bins of Deep Scale",
    "ablation-frame-gap": "Frame gap",
    "ablation-center-shift": "Centre shift",
    "ablation-nerf-sequences": "NeRF sequences",
    "ablation-plate-blur": "Blurred plates",
    "ablation-target-size": "Target size of grid sampling",
    "ablation-kernel-size": "Kernel size",
    "nerf-scripts": "Scripts of the NeRF sequences",
}
_SETTINGS: Final = {
    "n_scale_bins": "Bins",
    "frame_gap": "Frame gap",
    "center_shift": "Maximum shift",
    "n_nerf_sequences": "Sequences",
    "plates_blurred": "Plates",
    "target_size_px": "Size in px",
    "kernel_size_px": "Kernel in px",
}
# Names of rows and columns that are neither scores nor what the paper prints.
_LABELS: Final = {
    "scenes": "Scenes",
    "frequency_hz": "Frequency in Hz",
    "range_m": "Range in m",
    "has_2d_to_3d": "2D-to-3D boxes",
    "average_speed_m_per_s": "Average speed in m/s",
    "annotated_frames": "Annotated frames",
    "boxes": "Boxes",
    "hfov_half_angle_deg": "Half of the field of view",
    "direction": "Direction",
    "v_ego_km_per_h": "Ego in km/h",
    "v_vehicle_km_per_h": "Vehicle in km/h",
    "y_m": "Distance in m",
    "script": "Script",
    TIME: "Time in ms",
}
_FIRST_HEADINGS: Final = {"nerf-scripts": "No."}
_CAMERAS: Final = "camera-specification"


@dataclass(frozen=True, slots=True)
class PrintedRow:
    cells: tuple[str, ...]
    is_default: bool


@dataclass(frozen=True)
class PrintedTable:
    """A table as texts; the first `n_names` columns name a row, the others hold its values."""

    table: PublishedTable
    title: str
    headings: tuple[str, ...]
    rows: tuple[PrintedRow, ...]
    n_names: int

    @property
    def n_results(self) -> int:
        return sum(len(row.values) for row in self.table.rows) if self.table.is_result else 0

    @property
    def caption(self) -> str:
        return f"{self.table.caption.rstrip('.')}."

    @property
    def section(self) -> str:
        return f"Section {', '.join(self.table.section.split(' ', 1))}"

    @property
    def subject(self) -> str:
        """The split and the method of all rows, such as "Split val, Deep Scale"; empty where rows differ."""
        splits = {row.split for row in self.table.rows if row.split}
        methods = {method_name(row) for row in self.table.rows if row.method}
        words = [f"Split {split}" for split in splits if len(splits) == 1]
        return ", ".join(words + [method for method in methods if len(methods) == 1])

    @property
    def units(self) -> str:
        if not self.table.is_result:
            return ""
        metrics = dict.fromkeys(metric_of(name) for name in self.table.columns if name in SCORE_NAMES)
        text = f"{', '.join(metric.heading for metric in metrics)}; lower is better"
        time = self.table.units.get(TIME)
        return f"{text}; time in {time}" if time else text


def printed_tables() -> tuple[PrintedTable, ...]:
    return tuple(printed(table) for table in published_tables().tables)


def printed(table: PublishedTable) -> PrintedTable:
    names = _names(table)
    values = [_heading(table, column) for column in table.columns]
    rows = tuple(
        PrintedRow((*(text(row) for _, text in names), *_values(row)), row.is_default) for row in table.rows
    )
    headings = (*(heading for heading, _ in names), *values)
    return PrintedTable(table, _TITLES.get(table.name, table.name), headings, rows, len(names))


def _names(table: PublishedTable) -> list[tuple[str, Callable[[PublishedRow], str]]]:
    if not table.is_result:
        return [(_FIRST_HEADINGS.get(table.name, ""), lambda row: _LABELS.get(str(row.key), str(row.key)))]
    name_columns: list[tuple[str, Callable[[PublishedRow], str]]] = []
    if len({row.split for row in table.rows}) > 1:
        name_columns.append(("Split", lambda row: row.split or ""))
    if table.parameter is None or len({row.method for row in table.rows}) > 1:
        name_columns.append(("Method", method_name))
    if table.parameter is not None:
        name_columns.append((_SETTINGS.get(table.parameter, table.parameter), setting_text))
    return name_columns


def method_name(row: PublishedRow) -> str:
    """Name a row's method as the paper does, without citations."""
    name = published_tables().methods.get(row.method or "", row.method or "")
    return name.partition(" [")[0]


def setting_text(row: PublishedRow) -> str:
    if isinstance(row.setting, bool):
        return "blurred" if row.setting else "not blurred"
    return f"{row.setting:,}" if isinstance(row.setting, int) else str(row.setting)


def _heading(table: PublishedTable, column: str) -> str:
    if column in SCORE_NAMES:
        metric, (_, ttc_range) = metric_of(column), split_name(column)
        return metric.symbol if ttc_range == OVERALL else f"{metric.symbol} {ttc_range}"
    return f"Camera {column}" if table.name == _CAMERAS else _LABELS.get(column, column)


def _values(row: PublishedRow) -> Iterator[str]:
    if row.printed is not None:
        yield from row.printed
        return
    yield from map(_value_text, row.values)


def _value_text(value: Any) -> str:
    """Format a value; results have one decimal.

    >>> [_value_text(value) for value in (41.0, True, None, [-80, 80], [40, 60, 80], {"v_ego_minus": 20})]
    ['41.0', 'yes', '–', '−80 to 80', '40, 60, 80', 'ego − 20']
    """
    if value is None or isinstance(value, bool):
        return {None: ABSENT, True: "yes", False: "no"}[value]
    if isinstance(value, int | float):
        return (f"{value:.1f}" if isinstance(value, float) else str(value)).replace("-", "−")
    if isinstance(value, dict):
        return "as ego" if "equals" in value else f"ego − {value['v_ego_minus']}"
    return _list_text(value) if isinstance(value, list) else str(value)


def _list_text(values: list[Any]) -> str:
    texts = [_value_text(each).replace("'", "’") for each in values]
    if isinstance(values[0], str):
        return " ".join(f"{text.rstrip('.')}." for text in texts)
    return (" to " if len(values) == 2 and values[0] <= 0 else ", ").join(texts)


# --- formats ---------------------------------------------------------------------------------------------


def as_csv(shown: PrintedTable) -> str:
    """Write rows as CSV (RFC 4180), with names of scores, methods and settings for programs."""
    table = shown.table
    if not table.is_result:
        head = [name or "name" for name in shown.headings]
        return "".join(map(csv_line, [head, *(row.cells for row in shown.rows)]))
    names = ["split", "method", *([table.parameter, "is_default"] if table.parameter else [])]
    lines: list[list[object]] = [[*names, *table.columns]]
    for row in table.rows:
        setting = [str(row.setting).lower(), str(row.is_default).lower()] if table.parameter else []
        lines.append([row.split, row.method, *setting, *row.values])
    return "".join(map(csv_line, lines))


def as_latex(shown: PrintedTable) -> str:
    r"""Write a `tabular` of booktabs; the paper's default is bold."""
    n_values = len(shown.headings) - shown.n_names
    kind = "r" if shown.table.is_result else "l"
    rows = (
        " & ".join(rf"\textbf{{{latex(cell)}}}" if row.is_default else latex(cell) for cell in row.cells)
        for row in shown.rows
    )
    comments = [*about(shown), *([f"{shown.units}"] if shown.units else []), *shown.table.notes]
    return "\n".join(
        [
            *map(latex_comment, comments),
            r"% It needs \usepackage{booktabs}.",
            rf"\begin{{tabular}}{{{'l' * shown.n_names}{kind * n_values}}}",
            r"\toprule",
            rf"{' & '.join(map(latex, shown.headings))} \\",
            r"\midrule",
            *(rf"{row} \\" for row in rows),
            r"\bottomrule",
            r"\end{tabular}",
            "",
        ]
    )


def as_markdown(shown: PrintedTable) -> str:
    """Write a table of GitHub's Markdown; the paper's default is bold."""
    rule = "---:" if shown.table.is_result else "---"
    rules = ["---"] * shown.n_names + [rule] * (len(shown.headings) - shown.n_names)
    rows = (
        [f"**{markdown(cell)}**" if row.is_default else markdown(cell) for cell in row.cells]
        for row in shown.rows
    )
    lines = [_markdown_line(map(markdown, shown.headings)), _markdown_line(rules), *map(_markdown_line, rows)]
    below = [*([f"{shown.units}."] if shown.units else []), *shown.table.notes, *about(shown)]
    return "\n".join([*lines, *(f"\n{markdown(line)}" for line in below), ""])


def _markdown_line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def as_json(shown: PrintedTable) -> str:
    return json.dumps(document(shown), ensure_ascii=False, indent=2) + "\n"


def document(shown: PrintedTable) -> dict[str, Any]:
    table = shown.table
    return {
        "name": table.name,
        "title": shown.title,
        "section": table.section,
        "caption": table.caption,
        "is_result": table.is_result,
        "parameter": table.parameter,
        "columns": list(table.columns),
        "units": dict(table.units),
        "rows": [
            {
                "key": str(row.key),
                "split": row.split,
                "method": row.method,
                "setting": row.setting,
                "is_default": row.is_default,
                "values": list(row.values),
            }
            for row in table.rows
        ],
        "notes": list(table.notes),
        "paper_url": published_tables().source["url"],
    }


def about(shown: PrintedTable, tables: PublishedTables | None = None) -> tuple[str, ...]:
    source = (tables or published_tables()).source
    default = " The paper's default is bold." if any(row.is_default for row in shown.rows) else ""
    return (
        f"{shown.title}. {shown.caption}{default}",
        f"{source['title']} ({source['year']}), section {shown.table.section}: {source['url']}",
    )


WRITERS: Final[dict[str, Callable[[PrintedTable], str]]] = {
    "csv": as_csv,
    "latex": as_latex,
    "markdown": as_markdown,
    "json": as_json,
}
"""The formats of one table, by the names that the command knows."""
