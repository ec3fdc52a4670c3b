"""A board as a table for papers and notes: LaTeX and Markdown, from texts that are formatted already."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from evaluator.escaping import latex, latex_comment, markdown
from evaluator.protocol import INTERVAL_NAMES, METRICS

ABSENT: Final = "–"
_SYMBOLS: Final = {"mid": "MiD", "rte": "RTE"}
_LATEX_UNITS: Final = {"mid": r"$\times 10^{-4}$", "rte": r"\%"}
_UNITS: Final = {"mid": "×10⁻⁴", "rte": "%"}


@dataclass(frozen=True, slots=True)
class Cell:
    """A value as it is printed, with its 95 % interval as two texts where there is one."""

    text: str
    low: str = ""
    high: str = ""
    is_best: bool = False
    is_second: bool = False


@dataclass(frozen=True, slots=True)
class Row:
    """An entry. `rank` may hold its range, as in "2 (1–3)"; there is a cell for each column."""

    rank: str
    method: str
    team: str
    cells: tuple[Cell, ...]


def columns(metrics: Sequence[str] = METRICS) -> tuple[str, ...]:
    """The names of the columns of these errors, in the paper's order.

    >>> columns(["rte"])
    ('rte', 'rte_crucial', 'rte_small', 'rte_large', 'rte_negative')
    """
    return tuple(
        metric if name == "overall" else f"{metric}_{name}" for metric in metrics for name in INTERVAL_NAMES
    )


def as_latex(rows: Sequence[Row], *, about: Sequence[str], metrics: Sequence[str] = METRICS) -> str:
    r"""A `tabular` of the package booktabs. The best of a column is bold, the second underlined.

    `about` are lines of comment above it. With intervals, they stand small behind their values.
    """
    n = len(INTERVAL_NAMES)
    groups = [
        rf"\multicolumn{{{n}}}{{c}}{{{_SYMBOLS[metric]} ({_LATEX_UNITS[metric]}) $\downarrow$}}"
        for metric in metrics
    ]
    rules = [rf"\cmidrule(lr){{{4 + i * n}-{3 + (i + 1) * n}}}" for i in range(len(metrics))]
    return "\n".join(
        [
            *map(latex_comment, about),
            r"% It needs \usepackage{booktabs}.",
            rf"\begin{{tabular}}{{rll{'r' * n * len(metrics)}}}",
            r"\toprule",
            rf" & & & {' & '.join(groups)} \\",
            " ".join(rules),
            rf"Rank & Method & Team & {' & '.join(list(INTERVAL_NAMES) * len(metrics))} \\",
            r"\midrule",
            *map(latex_row, rows),
            r"\bottomrule",
            r"\end{tabular}",
            "",
        ]
    )


def latex_row(row: Row) -> str:
    """One line of such a table, for one that is there already."""
    # The rank comes first: a row that began with a bracket or a star would speak to the \\ before it.
    texts = [_latex_number(row.rank), latex(row.method), latex(row.team), *map(_latex_cell, row.cells)]
    return rf"{' & '.join(texts)} \\"


def _latex_cell(cell: Cell) -> str:
    text = _latex_number(cell.text)
    if cell.is_best:
        text = rf"\textbf{{{text}}}"
    elif cell.is_second:
        text = rf"\underline{{{text}}}"
    if cell.low and cell.high:
        text += rf" {{\scriptsize [{_latex_number(cell.low)}, {_latex_number(cell.high)}]}}"
    return text


def _latex_number(text: str) -> str:
    return text.replace("–", "--").replace("−", "$-$")


def as_markdown(rows: Sequence[Row], *, about: Sequence[str], metrics: Sequence[str] = METRICS) -> str:
    """A table of GitHub's Markdown. The best of a column is bold, the second italic; `about` stands below."""
    names = [f"{_SYMBOLS[metric]} {name}" for metric in metrics for name in INTERVAL_NAMES]
    units = ", ".join(f"{_SYMBOLS[metric]} in {_UNITS[metric]}" for metric in metrics)
    lines = [
        _line(["Rank", "Method", "Team", *names]),
        _line(["---:", "---", "---", *["---:"] * len(names)]),
        *(
            _line([row.rank, markdown(row.method), markdown(row.team), *map(_markdown_cell, row.cells)])
            for row in rows
        ),
        "",
        f"{units}; lower is better. Best of a column **bold**, second *italic*.",
    ]
    for line in about:
        lines += ["", markdown(line)]
    return "\n".join([*lines, ""])


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _markdown_cell(cell: Cell) -> str:
    text = f"**{cell.text}**" if cell.is_best else f"*{cell.text}*" if cell.is_second else cell.text
    return f"{text} [{cell.low}, {cell.high}]" if cell.low and cell.high else text
