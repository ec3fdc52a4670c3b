"""One's own results as a table: a row for each file, or for each group of its sequences."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from evaluator.metrics.protocol import OVERALL, grouped_names, metric_of, split_name
from evaluator.tables.escaping import latex, markdown
from evaluator.tables.formats import csv_lines
from evaluator.tables.layouts import ABSENT

Ends = tuple[float, float]


@dataclass(frozen=True, slots=True)
class ResultRow:
    """The scores of a file or group by name, None without value; `units` of the intervals, as "42 days"."""

    file: str
    group: str | None
    n_sequences: int
    n_recordings: int
    scores: Mapping[str, float | None]
    intervals: Mapping[str, Ends | None] = field(default_factory=dict)
    units: str = ""


def names_of(rows: Sequence[ResultRow], *, by: str | None) -> list[tuple[str, Callable[[ResultRow], str]]]:
    columns: list[tuple[str, Callable[[ResultRow], str]]] = []
    if len({row.file for row in rows}) > 1 or by is None:
        columns.append(("file", lambda row: row.file))
    if by is not None:
        columns.append((by, lambda row: str(row.group)))
    return columns


def as_csv(rows: Sequence[ResultRow], *, by: str | None) -> str:
    """Write CSV (RFC 4180) with all digits; ends of intervals are `mid_low` and `mid_high`."""
    records = []
    for row in rows:
        record: dict[str, object] = {"file": row.file} | ({by: row.group} if by else {})
        record |= {"n_sequences": row.n_sequences, "n_recordings": row.n_recordings}
        for name, value in row.scores.items():
            record[name] = value
            if row.intervals:
                record[f"{name}_low"], record[f"{name}_high"] = row.intervals[name] or (None, None)
        records.append(record)
    return "".join(csv_lines(records, columns=list(records[0]) if records else []))


def as_markdown(rows: Sequence[ResultRow], *, by: str | None) -> str:
    names, scores = names_of(rows, by=by), list(rows[0].scores)
    heads = [title for title, _ in names] + _titles(scores) + ["sequences"]
    lines = [heads, ["---"] * len(names) + ["---:"] * (len(scores) + 1)]
    for row in rows:
        texts = [markdown(of(row)) for _, of in names]
        lines.append([*texts, *cells_of(row), f"{row.n_sequences:,}"])
    return "".join(f"| {' | '.join(line)} |\n" for line in lines) + f"\n{_caption(rows)}\n"


def as_latex(rows: Sequence[ResultRow], *, by: str | None) -> str:
    """Write a `tabular` of booktabs; without its head, rows for an existing table."""
    names, scores = names_of(rows, by=by), list(rows[0].scores)
    heads = [title for title, _ in names] + _titles(scores)
    return "\n".join(
        [
            f"% {_caption(rows)}",
            rf"\begin{{tabular}}{{{'l' * len(names)}{'r' * len(scores)}}}",
            r"\toprule",
            rf"{' & '.join(map(latex, heads))} \\",
            r"\midrule",
            *(
                " & ".join([*(latex(of(row)) for _, of in names), *map(_latex_number, cells_of(row))])
                + r" \\"
                for row in rows
            ),
            r"\bottomrule",
            r"\end{tabular}",
            "",
        ]
    )


def _caption(rows: Sequence[ResultRow]) -> str:
    metrics = ", ".join(metric.heading for metric in grouped_names(rows[0].scores))
    caption = f"{metrics}; lower is better."
    if not any(row.units and any(row.intervals.values()) for row in rows):
        return caption
    return f"{caption} In square brackets: 95% confidence interval, bootstrap over {rows[0].units}."


def cells_of(row: ResultRow) -> Iterator[str]:
    from evaluator.scoring.results import format_rounded  # noqa: PLC0415 -- loads numpy

    for name, value in row.scores.items():
        decimals = metric_of(name).decimals
        text = format_rounded(value, decimals=decimals, missing=ABSENT)
        ends = row.intervals.get(name)
        low_high = [format_rounded(end, decimals=decimals) for end in ends] if ends else []
        yield f"{text} [{low_high[0]}, {low_high[1]}]" if low_high else text


def _titles(scores: Sequence[str]) -> list[str]:
    parts = [split_name(name) for name in scores]
    has_ranges = any(range_name != OVERALL for _, range_name in parts)
    return [
        f"{metric_of(metric).symbol} {range_name if has_ranges else ''}".rstrip()
        for metric, range_name in parts
    ]


def _latex_number(text: str) -> str:
    return text.replace("–", "--")


WRITERS: Final[dict[str, Callable[..., str]]] = {
    "csv": as_csv,
    "markdown": as_markdown,
    "latex": as_latex,
}
"""Writers by the names of `--format`; the format `table` is the command's own."""
