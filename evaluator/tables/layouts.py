"""A board as a table for papers and notes: LaTeX and Markdown, from texts that are formatted already.

The site's exports and the command line print their boards by this, so that the same board is the same table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Final

from evaluator.escaping import latex, latex_comment, markdown
from evaluator.protocol import INTERVAL_NAMES, METRICS

ABSENT: Final = "–"
BRACKETS: Final = (
    "In square brackets: 95 % confidence interval, bootstrap over recordings. In round brackets behind a "
    "rank: rank range at 95 %."
)
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """What a table was taken from. `address` is one at which the same board stays; None is not known."""

    split: str
    address: str
    edition: int | None = None
    protocol: str | None = None
    ground_truth: str | None = None  # its digest
    n_sequences: int | None = None
    n_recordings: int | None = None
    moment: datetime | None = None  # as of which
    has_own_rows: bool = False


def about(origin: Origin) -> tuple[str, ...]:
    """The lines that stand above or below a table: enough to find it again when the board has moved on."""
    lines = [f"TSTTC leaderboard, {origin.split}: {origin.address}"]
    if origin.edition is not None:
        facts = [f"Edition {origin.edition}"]
        if origin.protocol:
            facts.append(f"protocol {origin.protocol}")
        if origin.n_sequences is not None and origin.n_recordings is not None:
            facts.append(f"{origin.n_sequences:,} sequences of {origin.n_recordings:,} recordings")
        lines.append(", ".join(facts))
    if origin.ground_truth:
        lines.append(f"Ground truth {origin.ground_truth}")
    if origin.moment is not None:
        lines.append(f"As of {origin.moment.astimezone(UTC):%Y-%m-%d %H:%M} UTC")
    if origin.has_own_rows:
        lines.append(
            "Not what everybody sees: rows marked (private) are seen by one team alone, and others see those "
            "marked (anonymous) under a pseudonym"
        )
    return tuple(lines)


def mark_of(*, visibility: str, pseudonym: str | None) -> str:
    """What is said of a row of one's own that others do not see as it is; nothing of any other row.

    >>> mark_of(visibility="PRIVATE", pseudonym=None), mark_of(visibility="ANONYMOUS", pseudonym="Anon 3f")
    ('private', 'anonymous')
    >>> mark_of(visibility="ANONYMOUS", pseudonym=None), mark_of(visibility="PUBLIC", pseudonym=None)
    ('', '')
    """
    return "private" if visibility == "PRIVATE" else "anonymous" if pseudonym else ""


def marked(name: str, mark: str) -> str:
    """A name with what is said of its row.

    >>> marked("Owl", "private"), marked("Owl", "")
    ('Owl (private)', 'Owl')
    """
    return f"{name} ({mark})" if mark else name


def short_authors(authors: str) -> str:
    """Authors as a table has room for them.

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
    """A rank, and behind it where the row may stand.

    >>> rank_text(2), rank_text(2, low=1, high=3), rank_text(1, low=1, high=1), rank_text(None)
    ('2', '2 (1–3)', '1 (1)', '–')
    """
    text = ABSENT if rank is None else str(rank)
    if low is None or high is None:
        return text
    return f"{text} ({low}{f'–{high}' if high != low else ''})"


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

    `about` are lines of comment above it. With intervals, they stand small behind their values, and a comment
    says what the brackets are.
    """
    n = len(INTERVAL_NAMES)
    groups = [
        rf"\multicolumn{{{n}}}{{c}}{{{_SYMBOLS[metric]} ({_LATEX_UNITS[metric]}) $\downarrow$}}"
        for metric in metrics
    ]
    rules = [rf"\cmidrule(lr){{{4 + i * n}-{3 + (i + 1) * n}}}" for i in range(len(metrics))]
    return "\n".join(
        [
            *map(latex_comment, [*about, *_caption(rows)]),
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


def _caption(rows: Sequence[Row]) -> tuple[str, ...]:
    """What the brackets are, in a table that has some."""
    return (BRACKETS,) if any(cell.low and cell.high for row in rows for cell in row.cells) else ()


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
    for line in (*_caption(rows), *map(markdown, about)):
        lines += ["", line]
    return "\n".join([*lines, ""])


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _markdown_cell(cell: Cell) -> str:
    text = f"**{cell.text}**" if cell.is_best else f"*{cell.text}*" if cell.is_second else cell.text
    return f"{text} [{cell.low}, {cell.high}]" if cell.low and cell.high else text
