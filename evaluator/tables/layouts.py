"""A board as a table for papers and notes: LaTeX and Markdown, from texts that are formatted already."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, time
from typing import Final

from evaluator.counting import counted
from evaluator.metrics.protocol import grouped_names, metric_of, split_name
from evaluator.tables.escaping import latex, latex_comment, markdown, markdown_address
from evaluator.units import RECORDING, in_words

ABSENT: Final = "–"


@dataclass(frozen=True, slots=True)
class Cell:
    text: str
    low: str = ""
    high: str = ""
    is_best: bool = False
    is_second: bool = False


@dataclass(frozen=True, slots=True)
class Row:
    """An entry, with a cell per column; `rank` may include its range, as in "2 (1–3)"."""

    rank: str
    method: str
    team: str
    cells: tuple[Cell, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """The source of a table; `address` is permanent."""

    site: str  # its name
    split: str
    address: str
    edition: int | None = None
    protocol: str | None = None
    ground_truth: str | None = None  # its digest
    n_sequences: int | None = None
    n_recordings: int | None = None
    unit: str = RECORDING  # of the intervals
    n_units: int | None = None
    moment: datetime | None = None  # as of which
    has_own_rows: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Export:
    """A board for the export formats: `rows` of a table, all `records` by `columns`, BibTeX `references`."""

    # `rows` leave out withdrawn entries; `records` have published numbers or None.

    origin: Origin
    rows: Iterable[Row]
    columns: Sequence[str]
    records: Iterable[Mapping[str, object]]
    scores: Sequence[str] = ()  # of its tables
    references: Iterable[str] = ()
    eval_results: Iterable[str] = ()  # lines of a file of the Hugging Face Hub


def about(origin: Origin) -> tuple[str, ...]:
    """Describe the source of a table, so that a reader can retrieve it later."""
    lines = [f"{origin.site}, {origin.split}: {origin.address}"]
    if origin.edition is not None:
        facts = [f"Edition {origin.edition}"]
        if origin.protocol:
            facts.append(f"protocol {origin.protocol}")
        if origin.n_sequences is not None and origin.n_recordings is not None:
            facts.append(
                f"{counted(origin.n_sequences, 'sequence')} of {counted(origin.n_recordings, 'recording')}"
            )
        lines.append(", ".join(facts))
    if origin.ground_truth:
        lines.append(f"Ground truth {origin.ground_truth}")
    if origin.moment is not None:
        moment = origin.moment.astimezone(UTC)
        is_day = moment.time() == time.max  # so an anonymous row's day is written
        lines.append(f"As of {moment:%Y-%m-%d}" if is_day else f"As of {moment:%Y-%m-%d %H:%M} UTC")
    if origin.has_own_rows:
        lines.append(
            "Not public: only one team sees rows marked (private), and other teams see rows marked "
            "(anonymous) under a pseudonym"
        )
    return tuple(lines)


def mark_of(*, visibility: str, pseudonym: str | None) -> str:
    return "private" if visibility == "PRIVATE" else "anonymous" if pseudonym else ""


def marked(name: str, mark: str) -> str:
    return f"{name} ({mark})" if mark else name


def short_authors(authors: str) -> str:
    """Shorten authors for a table.

    >>> short_authors("Yuheng Shi, Zehao Huang, Yan Yan")
    'Shi et al.'
    >>> short_authors("Ada Lovelace, Charles Babbage"), short_authors("Ada Lovelace")
    ('Lovelace and Babbage', 'Ada Lovelace')
    """
    names = [name.strip() for name in authors.split(",") if name.strip()]
    if len(names) < 2:
        return authors
    surnames = [name.split()[-1] for name in names]
    return " and ".join(surnames) if len(names) == 2 else f"{surnames[0]} et al."


def rank_text(rank: int | None, *, low: int | None = None, high: int | None = None) -> str:
    """Format a rank, with its range.

    >>> rank_text(2), rank_text(2, low=1, high=3), rank_text(1, low=1, high=1), rank_text(None)
    ('2', '2 (1–3)', '1 (1)', '–')
    """
    text = ABSENT if rank is None else str(rank)
    if low is None or high is None:
        return text
    return f"{text} ({low}{f'–{high}' if high != low else ''})"


def as_latex(export: Export) -> str:
    r"""Write a `tabular` of booktabs; the best of a column is bold, the second underlined."""
    rows, columns = list(export.rows), export.scores
    groups, rules, last = [], [], 3
    for metric, names in grouped_names(columns).items():
        heading = f"{latex(metric.symbol)} ({_latex_unit(metric.unit)})"
        groups.append(rf"\multicolumn{{{len(names)}}}{{c}}{{{heading} $\downarrow$}}")
        rules.append(rf"\cmidrule(lr){{{last + 1}-{last + len(names)}}}")
        last += len(names)
    return "\n".join(
        [
            *map(latex_comment, [*about(export.origin), *_caption(rows, export.origin)]),
            r"% It needs \usepackage{booktabs}.",
            rf"\begin{{tabular}}{{rll{'r' * len(columns)}}}",
            r"\toprule",
            rf" & & & {' & '.join(groups)} \\",
            " ".join(rules),
            rf"Rank & Method & Team & {' & '.join(split_name(name)[1] for name in columns)} \\",
            r"\midrule",
            *map(latex_row, rows),
            r"\bottomrule",
            r"\end{tabular}",
            "",
        ]
    )


def _caption(rows: Sequence[Row], origin: Origin) -> tuple[str, ...]:
    has_some = any(cell.low and cell.high for row in rows for cell in row.cells)
    return (brackets(origin.unit, origin.n_units),) if has_some else ()


def brackets(unit: str, n_units: int | None) -> str:
    return (
        f"In square brackets: 95% confidence interval, bootstrap over {in_words(unit, n_units)}. In round "
        "brackets behind a rank: rank range at 95%."
    )


def latex_row(row: Row) -> str:
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


def _latex_unit(unit: str) -> str:
    if not unit.startswith("×10"):
        return latex(unit)
    return rf"$\times 10^{{{unicodedata.normalize('NFKC', unit[3:]).replace('−', '-')}}}$"


def _latex_number(text: str) -> str:
    return text.replace("–", "--").replace("−", "$-$")


def as_markdown(export: Export) -> str:
    """Write a table of GitHub's Markdown; the best of a column is bold, the second italic."""
    rows = list(export.rows)
    names = [f"{metric_of(name).symbol} {split_name(name)[1]}" for name in export.scores]
    units = ", ".join(metric.heading for metric in grouped_names(export.scores))
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
    first, *others = about(export.origin)
    # The address comes last in its line, and is a link.
    words = markdown(first.removesuffix(export.origin.address))
    source = f"{words} {markdown_address(export.origin.address)}"
    for line in (*_caption(rows, export.origin), source, *map(markdown, others)):
        lines += ["", line]
    return "\n".join([*lines, ""])


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _markdown_cell(cell: Cell) -> str:
    text = f"**{cell.text}**" if cell.is_best else f"*{cell.text}*" if cell.is_second else cell.text
    return f"{text} [{cell.low}, {cell.high}]" if cell.low and cell.high else text
