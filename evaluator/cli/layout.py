"""Text tables: columns that line up on the decimal point."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import click

from evaluator.counting import counted
from evaluator.metrics.protocol import OVERALL, grouped_names, metric_of, range_of, split_name

NO_VALUE = "–"
GAP = "  "


@dataclass(frozen=True, slots=True)
class Cell:
    text: str
    is_bold: bool = False
    is_underlined: bool = False


def short_name(score: str) -> str:
    symbol, ttc_range = metric_of(score).symbol, split_name(score)[1]
    return symbol if ttc_range == OVERALL else f"{symbol}_{ttc_range[0]}"


def units(scores: Iterable[str]) -> str:
    """Describe the units and TTC ranges of these scores."""
    groups = grouped_names(scores)
    ttc_ranges = dict.fromkeys(range_of(name) for names in groups.values() for name in names)
    ranges = ", ".join(f"{ttc_range.letter} {ttc_range.ends}" for ttc_range in ttc_ranges if ttc_range)
    metrics = f"{', '.join(metric.heading for metric in groups)}, lower is better"
    return f"{metrics}; TTC ranges in s: {ranges}" if ranges else metrics


def printable(text: str) -> str:
    """Escape the characters of `text` that move a terminal's cursor or reorder a line.

    >>> print(printable("Foo\\x1b[2J"))
    Foo\\x1b[2J
    """
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def aligned(rows: Sequence[Sequence[Cell]], *, align: str) -> list[str]:
    """Align rows into lines; `align` has a letter per column: `<` left, `>` right, `.` decimal point.

    >>> rows = [[Cell("a"), Cell("MiD")], [Cell("bb"), Cell("14.8")], [Cell("c"), Cell("9.25")]]
    >>> for line in aligned(rows, align="<."):
    ...     print(line)
    a     MiD
    bb  14.8
    c    9.25
    """
    columns = [_padded([row[i].text for row in rows], letter=letter) for i, letter in enumerate(align)]
    return [
        GAP.join(map(_styled, row, texts)).rstrip()
        for row, texts in zip(rows, zip(*columns, strict=True), strict=True)
    ]


def width_of(text: str) -> int:
    """Count the terminal cells of `text`: two for a wide (East Asian) character, none for a mark."""
    return sum(
        0 if unicodedata.combining(c) else 2 if unicodedata.east_asian_width(c) in "WF" else 1 for c in text
    )


def _padded(texts: Sequence[str], *, letter: str) -> list[str]:
    if letter == ".":
        tails = [len(text) - text.index(".") if "." in text else 0 for text in texts]
        # Headings, dashes and counts end where the numbers end; only a number is moved by its decimals.
        texts = [
            text + " " * (max(tails) - tail) if tail else text
            for text, tail in zip(texts, tails, strict=True)
        ]
    width = max(map(width_of, texts))
    pads = [" " * (width - width_of(text)) for text in texts]
    return [text + pad if letter == "<" else pad + text for text, pad in zip(texts, pads, strict=True)]


def _styled(cell: Cell, text: str) -> str:
    if not (cell.is_bold or cell.is_underlined):
        return text
    bare = text.strip()  # the padding is not underlined
    styled = click.style(bare, bold=cell.is_bold or None, underline=cell.is_underlined or None)
    return text.replace(bare, styled, 1)


def result_in_words(
    scores: Mapping[str, float | None],
    *,
    counts: Mapping[str, int],
    n_out_of_range: int,
    truncated: Mapping[str, int],
    decimals: int = 2,
    intervals: Mapping[str, tuple[float, float] | None] | None = None,
) -> Iterator[str]:
    yield from score_table(scores, counts=counts, decimals=decimals, intervals=intervals)
    yield ""
    yield units(scores)
    outside = f", {n_out_of_range:,} of them in no TTC range, which count in the overall scores only"
    yield f"{counted(counts.get(OVERALL, 0), 'sequence')}{outside if n_out_of_range else ''}."
    cut = [f"{n:,} set to {boundary.replace('-', '−')} s" for boundary, n in truncated.items() if n]
    yield f"Truncated predictions: {', '.join(cut) or 'none'}."


def score_table(
    scores: Mapping[str, float | None],
    *,
    counts: Mapping[str, int],
    decimals: int = 2,
    intervals: Mapping[str, tuple[float, float] | None] | None = None,
) -> list[str]:
    """Tabulate one result, with the ends of each interval and the number of sequences below each value."""
    from evaluator.scoring.results import format_rounded  # noqa: PLC0415 -- loads numpy, which --help can do without

    behind = [counts.get(split_name(name)[1]) for name in scores]
    rows = [
        [Cell(""), *(Cell(short_name(name), is_bold=True) for name in scores)],
        [
            Cell("error"),
            *(Cell(format_rounded(value, decimals=decimals, missing=NO_VALUE)) for value in scores.values()),
        ],
        *(
            [
                Cell(words),
                *(
                    Cell(format_rounded(ends[end] if ends else None, decimals=decimals, missing=NO_VALUE))
                    for ends in map(intervals.get, scores)
                ),
            ]
            for end, words in ((0, "95% from"), (1, "95% to"))
            if intervals
        ),
        [Cell("count"), *(Cell(NO_VALUE if n is None else f"{n:,}") for n in behind)],
    ]
    return aligned(rows, align="<" + "." * len(scores))
