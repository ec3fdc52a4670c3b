"""The subcommand board: who leads."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import click

from evaluator.cli.connection import connect
from evaluator.cli.failures import echo_json
from evaluator.cli.layout import NO_VALUE, UNITS, Cell, aligned, printable, short_name, width_of
from evaluator.cli.options import json_option, sendable, slug, url_option
from evaluator.cli.values import authors_or_team, texts_of
from evaluator.protocol import SCORE_NAMES

if TYPE_CHECKING:
    from evaluator.answers import Board


@click.command(short_help="Show the ranked results of a split.")
@click.argument("split", default="test", callback=slug)
@click.option(
    "--sort",
    callback=sendable,
    default="rank",
    show_default=True,
    metavar="COLUMN",
    help=f"Order by rank, method, team, date, {', '.join(SCORE_NAMES)}; -COLUMN for the reverse.",
)
@click.option(
    "--format",
    "as_format",
    type=click.Choice(["table", "json", "csv", "latex", "markdown"]),
    default="table",
    show_default=True,
    help="What to print.",
)
@click.option("--mine", is_flag=True, help="With your own team's private and anonymous methods, marked.")
@click.option(
    "--intervals", "has_intervals", is_flag=True, help="With the 95 % confidence interval of each value."
)
@click.option(
    "--edition",
    type=click.IntRange(min=1),
    metavar="N",
    help="The board of edition N, which stays as it is; without it the present one.",
)
@click.option(
    "--at",
    callback=sendable,
    metavar="MOMENT",
    help="The board as it stood then: a date, or a time such as 2026-11-20T18:00:00Z.",
)
@url_option
@json_option
def board(
    *,
    split: str,
    sort: str,
    as_format: str,
    mine: bool,
    has_intervals: bool,
    edition: int | None,
    at: str | None,
    url: str,
    as_json: bool,
) -> None:
    """Show the ranked results of SPLIT (test by default): submissions and published baselines.

    Needs no token, but for --mine. On a terminal the best value of a column is bold and the second
    underlined.

    \b
    Examples:
      tsttc board
      tsttc board val --sort rte_crucial
      tsttc board val --format latex --intervals > table.tex
      tsttc board test --edition 1
    """
    if edition is not None and at:
        raise click.UsageError("An edition's board has no other time: say --edition or --at.")
    with connect(url, with_token=mine) as client:
        found = client.board(split, sort=sort, edition=edition, at=at, has_intervals=has_intervals)
        address = client.board_page(found, sort=sort, at=at)
    if as_json or as_format == "json":
        echo_json(found.document)
    elif as_format == "table":
        _show(found, is_mine=mine)
    else:
        from evaluator.cli import formats  # noqa: PLC0415 -- tables of signs for LaTeX, seldom needed

        text = {
            "csv": lambda: formats.as_csv(found, has_intervals=has_intervals),
            "latex": lambda: formats.as_latex(found, address=address),
            "markdown": lambda: formats.as_markdown(found, address=address),
        }[as_format]()
        click.echo(text, nl=False)


def _show(found: Board, *, is_mine: bool) -> None:
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    for line in in_words(found, width=width):
        click.echo(line)
    if is_mine:
        click.echo(
            "\nPrivate methods of your team stand where they would; they take nobody's rank. "
            "Others see anonymous ones under a pseudonym."
        )


def in_words(found: Board, *, width: int | None) -> Iterator[str]:
    """The board as lines. Where `width` (cells) is too little for all columns, the main ones stay."""
    facts = [found.split]
    if found.edition is not None:
        facts.append(f"edition {found.edition}")
    if found.updated:
        facts.append(f"updated {found.updated}")
    yield printable(" · ".join(facts))
    if not found.entries:
        yield "No results yet. Be the first: tsttc submit --help"
        return
    yield UNITS
    yield ""
    lines = _table(found, texts=("team", "date"), scores=SCORE_NAMES)
    if width is not None and max(width_of(click.unstyle(line)) for line in lines) > width:
        lines = _table(found, texts=(), scores=("mid", "rte"))
        lines += ["", "Too narrow for all columns; a pipe or --json gets them."]
    yield from lines
    if any(entry.intervals for entry in found.entries):
        from evaluator.layouts import BRACKETS  # noqa: PLC0415 -- only for a board with intervals

        yield ""
        yield BRACKETS
    if found.floor:
        from evaluator.floors import floor_sentence  # noqa: PLC0415 -- loads numpy

        yield ""
        yield floor_sentence(found.floor, decimals=found.decimals or 2)


def _table(found: Board, *, texts: Sequence[str], scores: Sequence[str]) -> list[str]:
    from evaluator.cli import formats  # noqa: PLC0415 -- only once there is a board to print
    from evaluator.layouts import marked  # noqa: PLC0415 -- the same

    headings = ["rank", "method", *texts, *map(short_name, scores)]
    rows = [[Cell(text, is_bold=True) for text in headings]]
    marks = {name: formats.marks_of(found, name) for name in scores}
    for i, entry in enumerate(found.entries):
        row = [Cell(formats.rank_text(entry)), Cell(marked(printable(entry.method), formats.mark_of(entry)))]
        row += [
            Cell(printable(authors_or_team(entry)) if name == "team" else printable(entry.date or ""))
            for name in texts
        ]
        values = texts_of(entry, missing=NO_VALUE, scores=tuple(scores))
        for name, value in zip(scores, values, strict=True):
            best, second = marks[name]
            text = value + formats.interval_text(entry, name)
            row.append(Cell(text, is_bold=i in best, is_underlined=i in second))
        rows.append(row)
    return aligned(rows, align="><" + "<" * len(texts) + "." * len(scores))
