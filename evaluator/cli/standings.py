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
    from evaluator.answers import Board, BoardEntry


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
@click.option("--mine", is_flag=True, help="With your own team's private methods.")
@url_option
@json_option
def board(*, split: str, sort: str, as_format: str, mine: bool, url: str, as_json: bool) -> None:
    """Show the ranked results of SPLIT (test by default): submissions and published baselines.

    Needs no token, but for --mine. On a terminal the best value of a column is bold and the second
    underlined.

    \b
    Examples:
      tsttc board
      tsttc board val --sort rte_crucial
      tsttc board val --format latex > table.tex
    """
    with connect(url, with_token=mine) as client:
        found = client.board(split, sort=sort)
    if as_json or as_format == "json":
        echo_json(found.document)
        return
    if as_format != "table":
        from evaluator.cli import formats  # noqa: PLC0415 -- tables of signs for LaTeX, seldom needed

        write = {"csv": formats.as_csv, "latex": formats.as_latex, "markdown": formats.as_markdown}[as_format]
        click.echo(write(found), nl=False)
        return
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    for line in in_words(found, width=width):
        click.echo(line)
    if mine:
        click.echo("\nPrivate methods of your team stand where they would; they take nobody's rank.")


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
    lines = _table(found.entries, texts=("team", "date"), scores=SCORE_NAMES)
    if width is not None and max(width_of(click.unstyle(line)) for line in lines) > width:
        lines = _table(found.entries, texts=(), scores=("mid", "rte"))
        lines += ["", "Too narrow for all columns; a pipe or --json gets them."]
    yield from lines


def _table(entries: Sequence[BoardEntry], *, texts: Sequence[str], scores: Sequence[str]) -> list[str]:
    from evaluator.ranking import best_and_second  # noqa: PLC0415 -- only once there is a board to mark

    headings = ["rank", "method", *texts, *map(short_name, scores)]
    rows = [[Cell(text, is_bold=True) for text in headings]]
    marks = {name: best_and_second([entry.scores.get(name) for entry in entries]) for name in scores}
    for i, entry in enumerate(entries):
        row = [
            Cell(NO_VALUE if entry.rank is None else str(entry.rank)),
            Cell(printable(entry.method) + (" (private)" if entry.visibility == "PRIVATE" else "")),
        ]
        row += [
            Cell(printable(authors_or_team(entry)) if name == "team" else printable(entry.date or ""))
            for name in texts
        ]
        values = texts_of(entry, missing=NO_VALUE, scores=tuple(scores))
        for name, value in zip(scores, values, strict=True):
            best, second = marks[name]
            row.append(Cell(value, is_bold=i in best, is_underlined=i in second))
        rows.append(row)
    return aligned(rows, align="><" + "<" * len(texts) + "." * len(scores))
